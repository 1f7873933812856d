"""Motion between two frames: optical flow by windowed correlation in two dimensions, and what it means in metres."""
