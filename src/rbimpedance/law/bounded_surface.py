"""A sliding surface for errors far beyond the stated range: it sees a bounded error, so the arm comes no faster."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, BoolArray, check_gains, positive
from .._common.brief import brief_repr
from .._common.deprecation import renamed_arguments, renamed_attribute
from .._common.frozen import set_fields
from ..exceptions import ParameterError
from .formulas import clip, elementwise, select
from .surfaces import Surface, SurfaceByTerms, terms


def at_bound(e1: float, bound: float, feedforward: float, zoh_gain: float) -> tuple[float, float]:
    """Feed-forward and gain of a bounded surface, from those of the surface: beyond the bound s is constant in e1."""
    is_beyond = abs(e1) > bound
    return select(is_beyond, 0.0, feedforward), select(is_beyond, 1.0, zoh_gain)


@brief_repr()
@dataclass(frozen=True, eq=False, init=False)
class BoundedSurface(SurfaceByTerms):
    """Another surface that sees at most a stated error: abs(e1) > E counts as E.

    From far away the arm then approaches q_r at the constant speed that the surface has at E, instead of one that
    grows with the error. s is continuous and obeys the same reaching law, so the certificate holds with the sliding
    time of this surface. Its feed-forward is zero beyond E and therefore jumps at E, by slope·speed.
    `ControllerOutput.clipped` says where the bound acts.

    Attributes:
        surface: The surface.
        max_error: E > 0, scalar or (nv,) [rad or m].

    Raises:
        ParameterError: E is not positive, or the surface is bounded already.
    """

    surface: Surface
    max_error: Array

    @renamed_arguments(error="max_error")
    def __init__(self, surface: Surface, max_error: ArrayLike) -> None:
        if isinstance(surface, BoundedSurface):
            raise ParameterError("surface", surface, "a surface that is not bounded already")
        set_fields(self, surface=surface, max_error=positive("max_error", max_error))

    def check(self, nv: int) -> None:
        """Check that the bound and the surface's gains are for nv joints.

        Raises:
            DimensionError: One is not.
        """
        check_gains(self, nv, max_error=self.max_error)
        self.surface.check(nv)

    def clipped(self, e1: Array) -> BoolArray:
        """Where the bound acts, shape (nv,), bool.

        Args:
            e1: Position error, shape (nv,) [rad or m].
        """
        beyond: BoolArray = np.abs(e1) > self.max_error
        return beyond

    def terms(self, e1: Array, e2: Array, dt: float) -> tuple[Array, Array, Array]:
        """Return s at the bounded error, feed-forward and gain: 0 and 1 beyond the bound, where s is constant in e1."""
        s, *own = terms(self.surface, self._seen(e1), e2, dt)
        feedforward, zoh_gain = elementwise(at_bound, 2, e1, self.max_error, *own)
        return s, feedforward, zoh_gain

    def sliding_time(self, e1: ArrayLike) -> Array:
        """Time on s = 0 until e1 has settled: at constant speed to the bound, then the surface's own [s]."""
        return self._approach(self.max_error, e1) + self.surface.sliding_time(self._seen(e1))

    def time_to(self, tolerance: float, e1: ArrayLike) -> Array:
        """Time on s = 0 until abs(e1) is at the tolerance [s]."""
        end = np.maximum(self.max_error, tolerance)
        return self._approach(end, e1) + self.surface.time_to(tolerance, self._seen(e1))

    def speed(self, e1: ArrayLike) -> Array:
        """abs(e2) on s = 0, at most the surface's at E [rad/s or m/s].

        Args:
            e1: Position error [rad or m].
        """
        return self.surface.speed(self._seen(e1))

    def _seen(self, e1: ArrayLike) -> Array:
        seen: Array = elementwise(clip, 1, e1, -self.max_error, self.max_error)
        return seen

    def _approach(self, end: Array, e1: ArrayLike) -> Array:
        """Time at constant speed from e1 to abs(e1) = end."""
        way: Array = np.maximum(np.abs(e1) - end, 0.0)
        return way / self.surface.speed(self.max_error)

    error = renamed_attribute("error", "max_error")
    hold_gain = renamed_attribute("hold_gain", "zoh_gain")


def surface_terms(surface: Surface, e1: Array, e2: Array, dt: float) -> tuple[Array, Array, Array]:
    """Return s, feed-forward and gain of any surface; see `surfaces.terms`."""
    return (
        surface.terms(e1, e2, dt)
        if isinstance(surface, BoundedSurface)
        else terms(surface, e1, e2, dt)
    )


def clipped(surface: Surface, e1: Array) -> BoolArray:
    """Where a surface sees less than the whole error, shape (nv,), bool.

    Args:
        surface: The surface.
        e1: Position error, shape (nv,) [rad or m].
    """
    if isinstance(surface, BoundedSurface):
        return surface.clipped(e1)
    return np.zeros(e1.shape, dtype=np.bool_)
