// Takes messages of a live panel to the server over the page's own connection, and brings their answers.

import { hold, release } from "../shared/exchange.js";
import { unpacked } from "../shared/packing.js";

export default function ({ data, parentElement, setTriggerValue }) {
  const answer = unpacked(data);
  hold("carrier", answer.token, { ...answer, send: (message) => setTriggerValue("message", message) }, parentElement);
  return () => release(parentElement);
}
