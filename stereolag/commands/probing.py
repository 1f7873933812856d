"""Request the home page of a running app, as a browser does: the health check of a container."""

from __future__ import annotations

import time

from streamlit.proto.Alert_pb2 import Alert
from streamlit.proto.BackMsg_pb2 import BackMsg
from streamlit.proto.ClientState_pb2 import ClientState
from streamlit.proto.Element_pb2 import Element
from streamlit.proto.ForwardMsg_pb2 import ForwardMsg
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

PATIENCE_S = 60
"""How long the page may take on a busy machine."""


def served_fault(port: int) -> str | None:
    """Return in one line why the app on a local port does not serve its home page, or None if it does.

    Unlike ``/_stcore/health``, this runs the page in the process of the app.
    """
    end = time.monotonic() + PATIENCE_S
    address = f"ws://localhost:{port}/_stcore/stream"
    try:
        # A proxy in the environment does not apply to this machine.
        with connect(address, proxy=None, open_timeout=PATIENCE_S, max_size=None) as page:
            page.send(BackMsg(rerun_script=ClientState()).SerializeToString())
            while True:
                message = ForwardMsg.FromString(page.recv(timeout=end - time.monotonic(), decode=False))
                kind = message.WhichOneof("type")
                if kind == "delta" and (fault := _fault(message.delta.new_element)):
                    return fault
                if kind == "script_finished" and message.script_finished != ForwardMsg.FINISHED_EARLY_FOR_RERUN:
                    well = message.script_finished == ForwardMsg.FINISHED_SUCCESSFULLY
                    return None if well else "The page cannot be compiled."
    except TimeoutError:
        return f"No page came within {PATIENCE_S} s."
    except (OSError, WebSocketException) as error:
        return str(error)


def _fault(element: Element) -> str | None:
    """Return the failure that an element reports, in one line, or None if it reports none."""
    if element.WhichOneof("type") == "exception":
        return " ".join(f"{element.exception.type}: {element.exception.message}".split())
    if element.WhichOneof("type") == "alert" and element.alert.format == Alert.ERROR:
        return " ".join(element.alert.body.split())
    return None
