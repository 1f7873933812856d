// Passes a packed item to the component of the page that needs it, with a way to answer. Streamlit sends each delivery
// only if it has changed.

import { hold, release } from "../shared/exchange.js";
import { unpacked } from "../shared/packing.js";

export default function ({ data, parentElement, setTriggerValue }) {
  const item = unpacked(data);
  const send = (message) => setTriggerValue("message", message);
  hold(item.kind, item.name ?? item.digest, { ...item, send }, parentElement);
  return () => release(parentElement);
}
