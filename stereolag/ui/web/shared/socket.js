// The socket of a live stream: a token identifies its owner, and then packed items go both ways.

export function socketTo({ address, token }, opened, answered) {
  const { protocol, host } = window.location;
  const socket = new WebSocket(`${protocol === "https:" ? "wss:" : "ws:"}//${host}${address}`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => {
    socket.send(token);
    opened();
  };
  socket.onmessage = ({ data }) => answered(data);
  return socket;
}
