"""The direction of a step, from sums over all bodies."""

import numpy as np
import pytest
import warp as wp
from esh.engine.motion import kernels_direction as direction

MOST_STRETCH = 30.0


def decided(displacement, change, move):
    """The step that is decided on where the last one, and what it changed the moves by, are these vectors."""
    products = {
        direction.S_Y: displacement @ change,
        direction.S_S: displacement @ displacement,
        direction.Y_Y: change @ change,
        direction.S_M: displacement @ move,
        direction.Y_M: change @ move,
        direction.M_M: move @ move,
    }
    totals = np.zeros(direction.LENGTHS, np.int64)
    for kind, product in products.items():
        totals[int(kind)] = round(product * direction.SUM_SCALE)
    result = wp.zeros(4, dtype=float, device="cpu")
    wp.launch(
        direction.decide_direction,
        1,
        inputs=[
            0,
            1,
            1,
            0,
            MOST_STRETCH,
            wp.zeros(1, dtype=float, device="cpu"),
            wp.zeros(1, dtype=float, device="cpu"),
        ],
        outputs=[
            wp.zeros((1, len(totals), 1), dtype=wp.int64, device="cpu"),
            wp.array(totals, dtype=wp.int64, device="cpu"),
            wp.zeros(1, dtype=wp.int32, device="cpu"),
            result,
            wp.zeros(1, dtype=float, device="cpu"),
        ],
        device="cpu",
    )
    factor = result.numpy()
    return factor[0] * move + factor[1] * displacement + factor[2] * change


def bfgs(displacement, change, move):
    sy, g = displacement @ change, np.linalg.norm(displacement) / np.linalg.norm(change)
    sm, ym = displacement @ move, change @ move
    along = sm / sy * (1.0 + g * (change @ change) / sy) - g * ym / sy
    return g * move + along * displacement - g * sm / sy * change


# How far the change of the moves lies off the last step: nearly at a right angle there is next to no curvature along it.
@pytest.mark.parametrize("cosine, bounded", [(0.9, False), (0.3, False), (0.005, True)])
def test_a_step_is_that_of_bfgs_and_never_much_longer_than_the_moves(cosine, bounded):
    displacement = np.array([1.0, 0.0, 0.0])
    change = np.array([cosine, np.sqrt(1.0 - cosine**2), 0.0])
    move = np.array([0.5, 0.1, 0.3])
    asked, step = bfgs(displacement, change, move), decided(displacement, change, move)
    most = MOST_STRETCH * np.linalg.norm(move)
    assert (np.linalg.norm(asked) > most) == bounded
    wanted = asked * min(1.0, most / np.linalg.norm(asked))
    assert np.allclose(step, wanted, rtol=1e-3, atol=1e-3 * np.linalg.norm(wanted))
    assert step @ move > 0.0
