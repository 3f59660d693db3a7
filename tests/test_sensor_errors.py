"""What the table of errors of sensors adds up to."""

from __future__ import annotations

from benchmarks.sensor_errors import Learnt, table


def test_what_is_taken_off_is_held_against_the_plants_own_errors() -> None:
    found = [
        Learnt("1", "MAG", "gain", own=0.004, fitted=0.012, sd=0.004, written=0.012),
        Learnt("1", "RS", "gain", own=0.003, fitted=0.003, sd=0.004, written=0.0),
        Learnt("1", "MAG", "bias", own=0.4, fitted=0.2, sd=0.2, written=0.4),
        Learnt("1", "MAG", "bias", own=-0.3, fitted=-0.3, sd=0.2, written=0.4),
    ]
    _, gain, bias = (line.split() for line in table(found))
    assert gain == ["gain", "2", "1.41", "+1.00", "2.0", "2.28", "0.354", "%", "0.566", "%", "1", "0.604", "%"]
    assert bias == ["bias", "2", "0.71", "-0.50", "1.0", "0.68", "0.354", "K", "0.141", "K", "1", "0.495", "K"]
