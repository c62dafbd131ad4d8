"""The line buffer, and the faults that happen to lines on their way."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st

from r2s2r_cli.rig.transport.base import LineBuffer
from r2s2r_cli.rig.transport.faults import Channel
from r2s2r_cli.rig.world import Wire

LINES = [b"line %04d of many\n" % k for k in range(4000)]


def through(wire: Wire, lines: list[bytes] = LINES, *, stream: bool = True, seed: int = 1) -> list[bytes]:
    """What comes out of a channel into which a line goes every 10 ms."""
    channel = Channel(wire, np.random.default_rng(seed), stream=stream)
    out = []
    for k, line in enumerate([*lines, *[b""] * 100]):
        if line:
            channel.put(line, None, 0.01 * k)
        out += [data for data, _ in channel.take(0.01 * k)]
    return out


@given(st.lists(st.binary(max_size=20).map(lambda data: data.replace(b"\n", b"") + b"\n")), st.data())
def test_lines_come_out_whole_however_they_are_cut(lines: list[bytes], data: st.DataObject) -> None:
    """The same lines, whatever the pieces in which their bytes arrive."""
    stream, buffer, out = b"".join(lines), LineBuffer(), []
    while stream:
        n = data.draw(st.integers(1, len(stream)))
        out += buffer.feed(stream[:n])
        stream = stream[n:]
    assert out == lines


def test_a_line_without_end_is_thrown_away() -> None:
    """Of 10,000 bytes without a newline nothing is kept, the next line is whole, and one is counted."""
    buffer = LineBuffer(limit=16)
    for _ in range(1000):
        assert buffer.feed(b"0123456789") == []
        assert len(buffer._kept) <= 16
    assert buffer.feed(b"the end of it\nnext\n") == [b"next\n"]
    assert buffer.too_long == 1
    assert buffer.feed(b"0123456789abcde\n0123456789abcdef\nok\n") == [b"0123456789abcde\n", b"ok\n"]


def test_no_fault_is_no_change() -> None:
    """Without faults every line comes at once, as it was."""
    assert through(Wire()) == LINES


@pytest.mark.parametrize("stream", [True, False])
def test_equal_seeds_equal_faults(stream: bool) -> None:
    """The same seed gives the same bytes, another one others."""
    wire = Wire(lost=0.1, garbage=0.1, split=0.1, duplicate=0.1, reorder=0.1, bit_flip=0.1, delay_jitter_s=0.02)
    first, again, other = (through(wire, LINES[:300], stream=stream, seed=seed) for seed in (1, 1, 2))
    assert first == again
    assert first != other


def test_losses_and_doubles_have_their_share() -> None:
    """Of 4000 lines as many are lost, or come twice, as the file says, within four standard deviations."""
    lost = len(LINES) - len(through(Wire(lost=0.2)))
    assert abs(lost - 800) < 4 * np.sqrt(4000 * 0.2 * 0.8)
    twice = len(through(Wire(duplicate=0.3))) - len(LINES)
    assert abs(twice - 1200) < 4 * np.sqrt(4000 * 0.3 * 0.7)


def test_reordering_loses_nothing() -> None:
    """Lines change places with the next one; all arrive, the last one too."""
    out = through(Wire(reorder=0.3))
    assert sorted(out) == LINES
    assert out != LINES
    place = {line: i for i, line in enumerate(out)}
    assert max(abs(place[line] - i) for i, line in enumerate(LINES)) == 1


def test_a_flip_is_one_bit() -> None:
    """Every second line or so has exactly one bit turned over."""
    out = through(Wire(bit_flip=0.5))
    turned = [(int.from_bytes(a) ^ int.from_bytes(b)).bit_count() for a, b in zip(LINES, out, strict=True)]
    assert set(turned) == {0, 1}
    assert abs(sum(turned) - 2000) < 4 * np.sqrt(4000 * 0.25)


def test_split_lines_are_whole_in_a_stream_and_cut_off_in_datagrams() -> None:
    """A stream has every byte, in order, in more pieces; of a datagram the rest is lost."""
    stream = through(Wire(split=0.5, duplicate=0.2, delay_jitter_s=0.002, pause_s=0.005))
    plain = through(Wire(duplicate=0.2), stream=True)
    assert len(stream) > len(plain)
    lines = b"".join(stream).splitlines(keepends=True)
    assert set(lines) == set(LINES)
    cut = through(Wire(split=0.5), stream=False)
    assert len(cut) == len(LINES)
    assert all(line.startswith(piece) for line, piece in zip(LINES, cut, strict=True))


def test_jitter_keeps_the_order_of_a_stream_alone() -> None:
    """A serial line delays and never overtakes; datagrams do overtake each other."""
    assert through(Wire(delay_s=0.02, delay_jitter_s=0.02)) == LINES
    out = through(Wire(delay_jitter_s=0.05), stream=False)
    assert sorted(out) == LINES
    assert out != LINES


def test_garbage_comes_before_a_line() -> None:
    """With garbage before each, every line is still there at the end of what arrives."""
    out = through(Wire(garbage=1.0), LINES[:200])
    assert out[1::2] == LINES[:200]
    assert all(1 <= len(noise) <= 40 for noise in out[::2])


def test_a_safe_line_stands_alone() -> None:
    """What no fault may touch gets a line of its own where something unfinished was sent before."""
    channel = Channel(Wire(bit_flip=0.5), np.random.default_rng(0), stream=True)
    assert channel.whole(b"tick\n") == b"tick\n"
    channel.sent(b"half a li")
    assert channel.whole(b"tick\n") == b"\ntick\n"
