"""A page as the server sends it, read over Streamlit's own protocol."""

from streamlit.proto.BackMsg_pb2 import BackMsg
from streamlit.proto.ClientState_pb2 import ClientState
from streamlit.proto.Element_pb2 import Element
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


def faultless(messages: list[ForwardMsg]) -> list[Element]:
    """Return the elements of a page, and expect none of them to tell of a failure."""
    assert messages[-1].script_finished == ForwardMsg.FINISHED_SUCCESSFULLY
    shown = [message.delta.new_element for message in messages if message.WhichOneof("type") == "delta"]
    assert not [element for element in shown if element.WhichOneof("type") in ("exception", "alert")]
    return shown
