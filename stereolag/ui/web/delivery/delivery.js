// Hands a packed item to whichever component of the page needs it: Streamlit sends each delivery only if it has changed.

import { hold, release } from "../shared/exchange.js";
import { unpacked } from "../shared/packing.js";

export default function ({ data, parentElement }) {
  const item = unpacked(data);
  hold(item.kind, item.name ?? item.digest, item, parentElement);
  return () => release(parentElement);
}
