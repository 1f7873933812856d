"""The parts of the depth page, one subject each: every part shows one :class:`~stereolag.ui.depth.view.DepthView`."""
