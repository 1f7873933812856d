"""Depth maps of whole sequences, played side by side while they are still being computed."""

from stereolag.ui import prose
from stereolag.ui.driving.inputs import Drive, ask_drive, ask_methods, show_findings
from stereolag.ui.driving.work import call_off, show_downloads, show_work, work_on
from stereolag.ui.navigation import bench, fragment, page


@fragment
def workspace(drive: Drive) -> None:
    """Ask for the methods, compute and play; moving a control reruns only this fragment."""
    controls, result_place = bench()
    with controls:
        asked = ask_methods(drive)
        prose.caption(
            f"{drive.first.description} Near is bright, and the colours mean the same from the first frame to the last."
        )
    with result_place:
        if not asked.matchers:
            prose.info("Choose a method to compute its maps.", icon=":material/touch_app:")
            return
        show_findings(drive, asked.matchers.values())
        work = work_on(drive, asked)
        show_work(work, drive, asked)
        show_downloads(work, drive)


with page("Driving"):
    workspace(ask_drive(call_off))
