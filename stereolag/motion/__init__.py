"""Motion between two frames: optical flow by windowed correlation in two dimensions, and scene flow in metres."""
