"""Depth maps of whole sequences, played side by side while they are still being computed."""

from stereolag.ui import prose
from stereolag.ui.driving.inputs import Drive, ask_drive, ask_methods, show_findings
from stereolag.ui.driving.work import show_downloads, show_work, work_on
from stereolag.ui.navigation import fragment, page, show_try_first


@fragment
def workspace(drive: Drive) -> None:
    """Ask for the methods, compute and play; moving a control reruns only this fragment."""
    asked = ask_methods(drive)
    if not asked.matchers:
        prose.info("Choose a method, and its maps are computed.", icon=":material/touch_app:")
        return
    show_findings(drive, asked.matchers.values())
    work = work_on(drive, asked)
    show_work(work, drive, asked)
    show_downloads(work, drive)


with page(
    "Driving",
    "Depth maps of a whole drive, methods side by side. Near is bright, and the colours mean the "
    "same from the first frame to the last.",
):
    show_try_first("play it, and drag along the curves below the pictures.")
    chosen = ask_drive()
    if chosen is not None:
        workspace(chosen)
