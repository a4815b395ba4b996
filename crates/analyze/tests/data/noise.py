"""Numbers that Rust makes bit by bit too."""

import numpy as np


def noise(n, seed):
    """The same numbers as in tests/noise/mod.rs."""
    state, out = seed, []
    for _ in range(n):
        state = (state * 6364136223846793005 + 1442695040888963407) % 2**64
        out.append((state >> 11) / 2**53 - 0.5)
    return np.array(out)
