"""Parts of the depth page, one topic each; every part shows one :class:`~stereolag.ui.depth.view.DepthView`."""
