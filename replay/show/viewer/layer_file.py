"""A file for the viewer while it is written: lines, states, texts and keys, on the one timeline of its session. No name
steers the viewer: here it becomes plain text, and entity paths are escaped by the SDK."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.texts.plain import plain, plain_line
from replay.show.viewer.seen import APPLICATION, TIMELINES, path, rgba, sdk
from replay.written import written

Stamps = NDArray[np.int64]
LETTER = 7.0  # width of one in a key


@dataclass(frozen=True)
class LayerFile:
    """`stream`: the SDK's; `absolute`: whether stamps are UTC, else since the start."""

    stream: Any
    absolute: bool

    @classmethod
    @contextmanager
    def open(cls, id_: str, name: str, target: Path, layout: Any, absolute: bool) -> Iterator[LayerFile]:
        """The file `target` of the recording `id_`, with its layout, complete when the block ends."""
        stream = sdk().RecordingStream(APPLICATION, recording_id=id_)
        with written(target) as part:
            stream.save(part, default_blueprint=layout)
            stream.send_recording_name(plain_line(name))
            try:
                yield cls(stream, absolute)
            finally:
                stream.flush()
                stream.disconnect()

    def times(self, t_ns: Stamps) -> Any:
        """The timeline `time` in UTC, or `since_start` without absolute time: a timeline's name has one type."""
        if self.absolute:
            return sdk().TimeColumn(TIMELINES[1], timestamp=t_ns.astype("datetime64[ns]"))
        return sdk().TimeColumn(TIMELINES[0], duration=t_ns.astype("timedelta64[ns]"))

    def columns(self, where: str, t_ns: Stamps, columns: Any) -> None:
        """What an entity is from each of these moments on."""
        self.stream.send_columns(where, [self.times(t_ns)], columns)

    def line(self, where: str, name: str, colour: str, width: float, t_ns: Stamps, values: NDArray[np.float64]) -> None:
        """A line of values (N,); NaN is a gap."""
        rr = sdk()
        self.stream.log(
            where, rr.SeriesLines(colors=[rgba(colour)], widths=[width], names=[plain_line(name)]), static=True
        )
        self.columns(where, t_ns, rr.Scalars.columns(scalars=values))

    def states(self, where: str, t_ns: Stamps, states: Sequence[str], colours: Mapping[str, str] | None = None) -> None:
        """What holds from each of these moments on; `colours`: state -> its colour, else the viewer's own."""
        if colours:
            values = [rgba(colour) for colour in colours.values()]
            self.stream.log(where, sdk().StateConfiguration(values=list(colours), colors=values), static=True)
        self.columns(where, t_ns, sdk().StateChange.columns(state=list(states)))

    def log_texts(self, where: str, events: Sequence[tuple[int, str]]) -> None:
        """Lines of text, each at its moment [ns]."""
        if events:
            t_ns = np.array([at for at, _ in events], dtype=np.int64)
            self.columns(where, t_ns, sdk().TextLog.columns(text=[plain_line(text) for _, text in events]))

    def text(self, where: str, markdown: str) -> None:
        """A text that stands beside the whole session. Its tags, links and pictures are shown as they are written."""
        bare = plain(markdown).replace("<", "&lt;").replace("](", "] (").replace("]:", "] :")
        self.stream.log(where, sdk().TextDocument(bare, media_type="text/markdown"), static=True)

    def key(self, name: str, colours: Mapping[str, str]) -> None:
        """What colours mean, in a strip of its own, so that no legend covers a line: dots in a row, names below."""
        rr = sdk()
        wide = np.array([LETTER * (len(says) + 3) for says in colours])
        self.stream.log(
            path("key", name),
            rr.Points2D(
                np.column_stack([np.cumsum(wide) - wide / 2, np.zeros(len(wide))]),
                radii=rr.Radius.ui_points(7.0),
                colors=np.array([rgba(colour) for colour in colours.values()], dtype=np.uint32),
                labels=[plain_line(says) for says in colours],
                show_labels=True,
            ),
            static=True,
        )
