"""The commands ``data list`` and ``data inspect``."""

from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from loco_drake.cli.options import (
    SOURCES,
    DataDir,
    End,
    Fps,
    Json,
    Output,
    Start,
    UnusedSeed,
    option,
)
from loco_drake.cli.output import (
    check_output,
    do_all,
    print_table,
    write_figure,
    write_json,
)
from loco_drake.common.errors import InputError

if TYPE_CHECKING:
    from loco_drake.retargeting.cuts import Cut
    from loco_drake.retargeting.inspection import ClipSummary

_PLOTS = (".png", ".pdf", ".svg")


@dataclass(kw_only=True)
class DataList:
    """List the sources of motion with duration, gaits and licence."""

    data_dir: DataDir = None
    json: Json = None
    seed: UnusedSeed = 0

    def run(self) -> int:
        """Prints the table; returns 0."""
        from loco_drake.datasets.registry import DATASETS, data_dir
        from loco_drake.datasets.segments import read_segments

        segments = read_segments(data_dir(self.data_dir))
        figures: dict[str, dict[str, Any]] = {}
        for source, dataset in DATASETS.items():
            stretches = [segment for segment in segments if segment.source == source]
            figures[source] = {
                "clips": len(stretches),
                "frames": sum(segment.end - segment.start for segment in stretches),
                "seconds": sum(segment.seconds for segment in stretches),
                "rates_hz": sorted({segment.fps for segment in stretches}),
                "gaits": dict(Counter(segment.gait for segment in stretches)),
                "licence": dataset.licence,
                "attribution": dataset.attribution,
            }
        rows = [
            [
                source,
                str(row["clips"]),
                str(row["frames"]),
                f"{row['seconds']:.1f}",
                ", ".join(f"{rate:g}" for rate in row["rates_hz"]),
                ", ".join(f"{n} {gait}" for gait, n in row["gaits"].items()),
                f"{row['licence']}, {row['attribution']}",
            ]
            for source, row in figures.items()
        ]
        columns = ["source", "clips", "frames", "seconds", "Hz", "gaits", "licence"]
        do_all(
            lambda: print_table("Sources of motion", columns, rows),
            lambda: write_json(self.json, figures),
        )
        return 0


@dataclass(kw_only=True)
class DataInspect:
    """Plot toe heights, contacts and speeds of one stretch of a recording.

    With --skeleton, print what any BVH file or table of points holds, and propose the
    YAML file that makes it a source; see docs/own_animal.md.
    """

    # A recording.
    file: Annotated[Path, tyro.conf.Positional, option(metavar="FILE")]
    source: Annotated[
        str,
        option(
            f"{SOURCES}, whose format the file has; or a YAML file that names the "
            "joints of another animal's, see docs/own_animal.md.",
            metavar="SOURCE",
        ),
    ] = "dog"
    start: Start = None
    end: End = None
    fps: Fps = None
    # Print joints, rate, axes and unit, and propose a skeleton's YAML file.
    skeleton: bool = False
    # Plot to write: *.png, *.pdf or *.svg; with --skeleton the skeleton, *.yaml.
    out: Annotated[
        Path | None,
        option(
            name="save",
            metavar="FILE",
            default="a PNG file in the current folder, named like the recording; no "
            "YAML file, only its text",
        ),
        Output.FILE,
    ] = None
    json: Json = None
    seed: UnusedSeed = 0

    def run(self) -> int:
        """Writes picture or YAML file, and prints the figures; returns 0."""
        if self.skeleton:
            return self._inspect_skeleton()
        from loco_drake.datasets.registry import read_clip
        from loco_drake.datasets.skeleton import load_source
        from loco_drake.retargeting.cuts import propose_cuts
        from loco_drake.retargeting.inspection import clip_figure, summarize

        source = load_source(self.source)
        if self.out is not None and self.out.suffix.lower() not in ("", *_PLOTS):
            raise InputError(
                f"A plot ends in {', '.join(_PLOTS)}, unlike {self.out}; a skeleton's "
                "file needs --skeleton."
            )
        clip = read_clip(source, self.file, "unknown", self.start, self.end, self.fps)
        summary, contacts = summarize(clip)
        cuts = propose_cuts(clip)
        stretch = f"{self.file.stem}-{clip.provenance['frames']}"
        out = self.out or Path(f"{stretch}.png")
        check_output(out)
        plot = clip_figure(clip, contacts, cuts, stretch)
        licence = clip.provenance["licence"]
        proposed = [asdict(cut) for cut in cuts]
        figures = {**asdict(summary), "cuts": proposed, "licence": licence}
        do_all(
            lambda: print_table(
                f"{stretch}, drawn in {out}", ["", "value"], _rows(summary)
            ),
            lambda: _print_cuts(cuts),
            lambda: write_json(self.json, figures),
            lambda: write_figure(plot, out, dpi=100),
        )
        return 0

    def _inspect_skeleton(self) -> int:
        from loco_drake.cli.inspect_skeleton import inspect_skeleton

        if self.source != "dog" or (self.start, self.end) != (None, None):
            raise InputError(
                "--skeleton reads the whole of any file; it takes no --source, --start "
                "and --end."
            )
        write_json(self.json, inspect_skeleton(self.file, self.fps, self.out))
        return 0


def _print_cuts(cuts: "list[Cut]") -> None:
    if len(cuts) < 2:
        return
    rows = [
        [
            f"{cut.start}-{cut.end}",
            cut.guess,
            f"{cut.seconds:.1f}",
            f"{cut.speed_mean_mps:.2f}",
            _text(cut.stride_period_s),
        ]
        for cut in cuts
    ]
    print_table(
        "Proposed cuts", ["frames", "like", "seconds", "m/s", "stride, s"], rows
    )
    kinds = ", ".join(dict.fromkeys(cut.guess for cut in cuts))
    longest = max(
        cuts, key=lambda cut: cut.seconds if cut.stride_period_s is not None else 0.0
    )
    print(
        f"It holds {kinds}, and begins with {cuts[0].seconds:.1f} s of "
        f"{cuts[0].guess}: cut it, such as with --start {longest.start} --end "
        f"{longest.end}."
    )


def _text(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


def _rows(summary: "ClipSummary") -> list[list[str]]:
    rows = [["frames", str(summary.frames)]]
    names = {
        "fps": "frames/s",
        "seconds": "seconds",
        "stance_height_m": "stance height, m",
        "speed_mean_mps": "mean speed, m/s",
        "stride_period_s": "stride period, s",
    }
    rows += [[name, _text(getattr(summary, key))] for key, name in names.items()]
    for key, name in (("duty_factor", "duty factor"), ("phase", "lag behind RL")):
        values = "  ".join(_text(value) for value in getattr(summary, key) or (None,))
        rows.append([f"{name}: FL FR RL RR", values])
    return rows
