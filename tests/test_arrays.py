"""The border for arrays: what passes, what is refused, and whose memory it is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from numpy.testing import assert_array_equal

import rbimpedance as rbi
from rbimpedance._common.arrays import gain, per_joint, positive, positive_number, vector

REALS = ["<f8", ">f8", "<f4", ">f4", "<i4", ">i8", "u1", "f2"]


@pytest.mark.slow
@settings(max_examples=60)
@given(kind=st.sampled_from(REALS), stride=st.sampled_from([1, 2, -1, -3]), data=st.data())
def test_every_real_form_becomes_the_same_native_vector(
    kind: str, stride: int, data: st.DataObject
) -> None:
    values = data.draw(npst.arrays(np.int64, 12, elements=st.integers(0, 100)))
    got = vector("x", values.astype(kind)[::stride], len(values[::stride]))
    assert got.dtype == np.dtype("f8")
    assert got.dtype.isnative
    assert got.flags.c_contiguous
    assert_array_equal(got, values[::stride].astype(float))


@pytest.mark.parametrize("value", [[1, 2, 3], (1.0, 2.0, 3.0), range(1, 4)])
def test_sequences_are_vectors(value: Any) -> None:
    assert_array_equal(vector("x", value, 3), [1.0, 2.0, 3.0])


def test_float64_vector_passes_without_a_copy() -> None:
    x = np.arange(3.0)
    assert vector("x", x, 3) is x


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (np.zeros(2), r"shape \(2,\)"),
        (np.zeros((1, 3)), r"shape \(1, 3\)"),
        (0.0, r"shape \(\)"),
        ([], r"shape \(0,\)"),
        ([[1.0], [1.0, 2.0]], "a ragged sequence"),
        (np.zeros(3, dtype=complex), "dtype complex128"),
        (np.zeros(3, dtype=bool), "dtype bool"),
        (["0", "0", "0"], "dtype <U1"),
        ([b"0", b"0", b"0"], r"dtype \|S1"),
        ([0.0, None, 0.0], "dtype object"),
        ({1.0, 2.0, 3.0}, "dtype object"),
        (np.zeros(3, dtype="M8[s]"), "dtype datetime64"),
        (None, "dtype object"),
    ],
)
def test_unusable_vector_is_refused_with_what_it_is(value: Any, words: str) -> None:
    expected = rf"^v must be a vector of shape \(nv,\) = \(3,\), got {words}"
    with pytest.raises(rbi.DimensionError, match=expected) as caught:
        vector("v", value, 3)
    assert caught.value.name == "v"


def test_scalar_is_no_vector_of_one() -> None:
    with pytest.raises(rbi.DimensionError, match=r"got shape \(\)"):
        vector("v", 1.0, 1)


def test_vector_of_any_length_is_still_a_vector() -> None:
    assert_array_equal(vector("times", [0, 1, 2], None, "n"), [0.0, 1.0, 2.0])
    with pytest.raises(rbi.DimensionError, match=r"times must be a vector of shape \(n,\), got"):
        vector("times", 0.0, None, "n")


@settings(max_examples=30)
@given(
    where=st.sets(st.integers(0, 4), min_size=1),
    what=st.sampled_from([np.nan, np.inf, -np.inf]),
)
def test_non_finite_entries_are_named(where: set[int], what: float) -> None:
    x = np.zeros(5)
    x[list(where)] = what
    with pytest.raises(rbi.NonFiniteError, match=r"^tau_ext must be finite") as caught:
        vector("tau_ext", x, 5)
    assert caught.value.index == tuple(sorted(where))


def test_gain_is_a_read_only_copy() -> None:
    given_gain = np.array([1.0, 2.0])
    got = positive("k1", given_gain)
    given_gain[0] = -1.0
    assert_array_equal(got, [1.0, 2.0])
    with pytest.raises(ValueError, match="read-only"):
        got[0] = 3.0


@pytest.mark.parametrize("value", [8, 8.0, np.float32(8.0), np.array(8.0), np.int64(8)])
def test_scalar_gain_stays_a_scalar(value: Any) -> None:
    got = positive("k1", value)
    assert got.shape == ()
    assert got == 8.0


@pytest.mark.parametrize(
    "value",
    [
        0.0, -1.0, np.nan, np.inf, [1.0, 0.0], [[1.0]], "8", True, 1j, np.array([1j]), None,
        [[1.0], []], object(),
    ],
)  # fmt: skip
def test_unusable_gain_is_refused(value: Any) -> None:
    with pytest.raises(
        rbi.ParameterError, match=r"^k1 must be positive and finite, a scalar or one"
    ):
        positive("k1", value)


def test_gain_outside_its_set_is_told_the_set() -> None:
    with pytest.raises(rbi.ParameterError, match=r"^margin must be at least 1 and finite.*got 0.5"):
        gain("margin", 0.5, "at least 1", lambda x: x >= 1.0)


@pytest.mark.parametrize("value", [1e-3, 1, np.float32(0.5), np.int32(2)])
def test_positive_number_is_a_float(value: Any) -> None:
    got = positive_number("dt", value, "period in seconds")
    assert type(got) is float
    assert got == value


@pytest.mark.parametrize(
    "value", [0, 0.0, -1e-3, np.nan, np.inf, "1", True, 1 + 0j, None, [1.0], np.array([1.0])]
)
def test_unusable_number_is_refused(value: Any) -> None:
    with pytest.raises(
        rbi.ParameterError, match=r"^dt must be a positive, finite period in seconds"
    ):
        positive_number("dt", value, "period in seconds")


def test_scalar_gain_spreads_over_the_joints() -> None:
    assert_array_equal(per_joint("k1", np.array(2.0), 3), [2.0, 2.0, 2.0])


def test_gain_per_joint_stays_as_it_is() -> None:
    assert_array_equal(per_joint("k1", np.array([1.0, 2.0]), 2), [1.0, 2.0])


@pytest.mark.parametrize("value", [np.ones(2), np.ones(1), np.ones((3, 3))])
def test_gain_for_another_number_of_joints_is_refused(value: Any) -> None:
    with pytest.raises(rbi.DimensionError, match=r"^k1 must be .* shape \(nv,\) = \(3,\), got"):
        per_joint("k1", value, 3)
