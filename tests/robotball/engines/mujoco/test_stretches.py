"""A run's steps are laid so that they end wherever they must."""

import numpy as np

from robotball.engines.mujoco.stepping import stretches


def test_steps_end_on_every_sample_and_breakpoint() -> None:
    """Spans are divided evenly, none longer than the timestep, in stretches of bounded length."""
    times, breaks = np.array([0.0, 0.013, 40.0]), (0.5, 7.0)
    parts = list(stretches(times, breaks, timestep=1e-3))
    edges = np.concatenate([part.ends for part in parts])
    counts = np.concatenate([part.counts for part in parts])
    assert set(np.round(edges[:, 1], 9)) >= {0.013, 0.5, 7.0, 40.0}
    np.testing.assert_allclose(edges[1:, 0], edges[:-1, 1], rtol=1e-12)
    assert all(part.counts.sum() <= 2 * 4096 for part in parts)
    assert counts.sum() == 40_001 - 1
    starts = np.concatenate(
        [
            part.samples + before
            for part, before in zip(
                parts, np.cumsum([0, *(int(part.counts.sum()) for part in parts[:-1])]), strict=True
            )
        ]
    )
    assert starts.tolist() == [0, 13]
