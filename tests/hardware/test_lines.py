"""Lines from a stream that cuts where it likes."""

from __future__ import annotations

from hypothesis import given, strategies as st

from r2s2r_cli.hardware.transport.lines import MOST, LineBuffer


def taken(buffer: LineBuffer) -> list[bytes]:
    """All complete lines."""
    return list(iter(buffer.take, None))


@given(st.lists(st.binary(max_size=40).map(lambda b: b.replace(b"\n", b" ")), max_size=12), st.data())
def test_cuts_change_nothing(lines: list[bytes], data: st.DataObject) -> None:
    """However the bytes are cut, the same lines come out, but for the first, of which we may have missed a part."""
    stream = b"".join(line + b"\n" for line in [b"part", *lines])
    buffer = LineBuffer()
    while stream:
        size = data.draw(st.integers(1, len(stream)))
        buffer.feed(stream[:size])
        stream = stream[size:]
    assert taken(buffer) == lines
    assert buffer.overlong == 0


def test_a_line_that_does_not_end_is_thrown_away_and_counted_once() -> None:
    """Neither memory nor the line after it suffer, whatever the size of the pieces."""
    for piece in (1, 100, 10_000):
        buffer = LineBuffer()
        buffer.feed(b"part\n")
        stream = b"x" * 5 * MOST + b"\ngood\n" + b"y" * MOST + b"\n" + b"z" * (MOST - 1) + b"\n"
        for i in range(0, len(stream), piece):
            buffer.feed(stream[i : i + piece])
            assert len(buffer._rest) < MOST
        assert taken(buffer) == [b"good", b"z" * (MOST - 1)]
        assert buffer.overlong == 2
