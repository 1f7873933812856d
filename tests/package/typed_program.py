"""A program with the types of the library, which nothing runs: ``make check`` checks it, strictly.

The last comment is reported as unused unless the types are known. ``test_package.py`` holds that the wheel brings them.
"""

from stereolag import (
    CorrelationMatcher,
    DisparityMap,
    SearchArea,
    SignalLag,
    StereoBM,
    __version__,
    read_image,
    samples,
    signal_lag,
)

pair = samples.stereo_pairs()["cube"]
matcher = CorrelationMatcher(window_size=9, search=SearchArea.rectified(64))
depth_map: DisparityMap = matcher.compute(read_image(pair.left), read_image(pair.right))
lag: SignalLag = signal_lag(depth_map.disparity[0], depth_map.disparity[1], sampling_rate=1.0)
made_by: str = f"stereolag {__version__}"
coverage: float = StereoBM(num_disparities=64).compute(read_image(pair.left), read_image(pair.right)).coverage
StereoBM(no_such_setting=1)  # type: ignore[call-arg]
