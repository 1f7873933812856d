"""A page as the server sends it, read over Streamlit's own protocol."""

from __future__ import annotations

from streamlit.proto.BackMsg_pb2 import BackMsg
from streamlit.proto.ClientState_pb2 import ClientState
from streamlit.proto.ForwardMsg_pb2 import ForwardMsg
from websockets.sync.client import connect

PATIENCE_S = 120


def visit(address: str, page_name: str = "") -> list[ForwardMsg]:
    """Open a page as a browser does (by default the home page) and return all messages that the server sends for it."""
    messages = []
    with connect(f"{address.replace('http', 'ws')}/_stcore/stream", max_size=None) as page:
        page.send(BackMsg(rerun_script=ClientState(page_name=page_name)).SerializeToString())
        while not messages or messages[-1].WhichOneof("type") != "script_finished":
            messages.append(ForwardMsg.FromString(page.recv(timeout=PATIENCE_S, decode=False)))
    return messages
