// Evaluates functions of the app's modules for Python: a request a line, and an answer a line, both JSON.

import { createInterface } from "node:readline";

const WEB = new URL("../../stereolag/ui/web/", import.meta.url);

for await (const line of createInterface({ input: process.stdin })) {
  const { module, code, given } = JSON.parse(line);
  const found = new Function("module", "given", `return (${code})(module, given)`)(await import(new URL(module, WEB).href), given);
  console.log(JSON.stringify(found, (_, value) => (ArrayBuffer.isView(value) ? [...value] : value)));
}
