"""Whether the joints' laws are stable together, however strongly the joints are coupled.

The law acts joint by joint, the plant couples the joints: ṡ = -G·y with y = k1·sig(s)^½ and G = M_true⁻¹·κ·M_model.
With V = Σ dᵢ·⅔·k1ᵢ·abs(sᵢ)^(3/2) and D = diag(d), V̇ = -yᵀ·D·G·y: the root part of the law is stable for all gains where
one diagonal D makes D·G + Gᵀ·D positive definite. That is linear in G: what holds at some G holds between them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog

from .._common.arrays import Array

_ROUNDS, _CUTS = 60, 8
_LEAST_WEIGHT = 1e-4  # of a joint, where the mean is 1
_POSITIVE = 1e-9  # eigenvalue that is above zero also after rounding


class Coupling(NamedTuple):
    """What the input gains G of all samples say of the joints together.

    Attributes:
        weights: d, with mean 1, shape (nv,); None where no D is found: stability is then not proven, not refuted.
        gain: Smallest input gain in that metric: D·G + Gᵀ·D ⪰ 2·gain·D; NaN without weights.
        least: Smallest input gain of a joint on itself, Gᵢᵢ.
        joint: Of which joint.
        pair: The two joints whose coupling leaves least room for weights, or does not allow any.
    """

    weights: Array | None
    gain: float
    least: float
    joint: int
    pair: tuple[int, int]

    @property
    def is_proven(self) -> bool:
        """Whether weights were found."""
        return self.weights is not None


def coupling_of(gains: Array) -> Coupling:
    """Return the coupling of input gains, shape (N, nv, nv)."""
    own = gains.diagonal(axis1=1, axis2=2).min(axis=0)
    joint = int(own.argmin())
    weights = common_weights(gains) if own[joint] > 0.0 else None
    gain = np.nan if weights is None else _gain(gains, weights)
    return Coupling(weights, gain, float(own[joint]), joint, _tightest_pair(gains))


def common_weights(gains: Array) -> Array | None:
    """Return d with D·G + Gᵀ·D positive definite for all G, shape (nv,); None where there is none, or it is hard.

    Linear programs with cutting planes: for a vector w, wᵀ·(D·G + Gᵀ·D)·w is linear in d.

    Args:
        gains: G, shape (N, nv, nv).
    """
    nv = gains.shape[1]
    cuts = np.empty((0, nv))
    d = np.ones(nv)
    for _ in range(_ROUNDS):
        half = d[:, None] * gains
        values, vectors = np.linalg.eigh(half + half.swapaxes(1, 2))
        if values[:, 0].min() > _POSITIVE:
            return d
        worst = values[:, 0].argsort()[:_CUTS]
        w = vectors[worst, :, 0]
        cuts = np.vstack([cuts, 2.0 * w * (gains[worst] @ w[:, :, None])[:, :, 0]])
        found = _best(cuts)
        if found is None:
            return None
        d = found
    return None


def _best(cuts: Array) -> Array | None:
    """The weights whose smallest cut is largest; None where it is not positive."""
    count, nv = cuts.shape
    answer = linprog(
        np.append(np.zeros(nv), -1.0),
        A_ub=np.column_stack([-cuts, np.ones(count)]),
        b_ub=np.zeros(count),
        A_eq=np.append(np.ones(nv), 0.0)[None],
        b_eq=[float(nv)],
        bounds=[*[(_LEAST_WEIGHT, None)] * nv, (None, 1.0)],
    )
    if answer.x is None or answer.x[nv] <= _POSITIVE:
        return None
    return np.array(answer.x[:nv])


def _gain(gains: Array, weights: Array) -> float:
    """Smallest eigenvalue of the symmetric part of D^½·G·D^-½."""
    root = np.sqrt(weights)
    scaled = root[:, None] * gains / root
    return float(np.linalg.eigvalsh(scaled + scaled.swapaxes(1, 2))[:, 0].min() / 2.0)


def _tightest_pair(gains: Array) -> tuple[int, int]:
    """The pair of joints with the least room for the ratio of their weights, over all G.

    For two joints a ratio r = dⱼ/dᵢ is right where (Gᵢⱼ + r·Gⱼᵢ)² < 4·r·Gᵢᵢ·Gⱼⱼ, which is an interval.
    """
    nv = gains.shape[1]
    pairs = [(i, j) for i in range(nv) for j in range(i)] or [(0, 0)]
    return min(pairs, key=lambda pair: _room(gains, *pair))


def _room(gains: Array, i: int, j: int) -> float:
    """Logarithm of the largest allowed ratio of two weights over the smallest; negative where there is none."""
    own, cross = gains[:, i, i] * gains[:, j, j], gains[:, i, j] * gains[:, j, i]
    if (own <= 0.0).any() or (own <= cross).any():
        return -np.inf
    middle, half = 2.0 * own - cross, 2.0 * np.sqrt(own * (own - cross))
    with np.errstate(divide="ignore"):
        low, high = gains[:, i, j] ** 2 / (middle + half), (middle + half) / gains[:, j, i] ** 2
        return float(np.log(high.min()) - np.log(low.max()))
