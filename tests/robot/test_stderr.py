"""What is written to file descriptor 2."""

from __future__ import annotations

import os

import pytest

from rbimpedance.robot.loading.stderr import captured_stderr


def test_what_is_written_is_kept_and_not_shown(capfd: pytest.CaptureFixture[str]) -> None:
    with captured_stderr() as messages:
        os.write(2, b"Error:   one\n         at line 3 in source.cpp\ntwo\n")
        assert messages() == "Error:   one two"
    os.write(2, b"after")
    assert capfd.readouterr().err == "after"


def test_descriptor_is_given_back_after_an_error(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValueError, match="inside"), captured_stderr():
        raise ValueError("inside")
    os.write(2, b"after")
    assert capfd.readouterr().err == "after"
