"""Processor time of a call, for the scripts that compare times."""

import time
from collections.abc import Callable


def least(action: Callable[[], object], repeats: int) -> float:
    """Processor seconds of the fastest of some calls."""
    seconds = []
    for _ in range(repeats):
        begun = time.process_time()
        action()
        seconds.append(time.process_time() - begun)
    return min(seconds)
