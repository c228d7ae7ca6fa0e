"""The command ``data pack``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from loco_drake.cli.options import Json, MotionFolders, OutFolder, UnusedSeed
from loco_drake.cli.output import do_all, print_table, write_json
from loco_drake.common.progress import progress_bar


@dataclass(kw_only=True)
class DataPack:
    """Pack Motion files, such as a hundred thousand, in a folder of few large files.

    Every command that takes a folder of Motion files takes the packed folder, too. The
    files are checked, and kept as they are. Ctrl-C stops; --resume continues.
    """

    # Folder of Motion files: several may be named, also packed ones.
    motions: MotionFolders = (Path("motions/go2"),)
    # Folder to write to: shards of up to 1000 motions, and motions.jsonl, their index.
    out: OutFolder = Path("motions/packed")
    # Continue what is in --out: shards that are as the files are kept, others written.
    resume: bool = False
    json: Json = None
    seed: UnusedSeed = 0

    def run(self) -> int:
        """Packs, and prints what there is; returns 0."""
        from loco_drake.motion.packing import pack

        with progress_bar() as bar:
            task = bar.add_task("Packing", total=None, note="")

            def report(done: int, total: int) -> None:
                bar.update(task, completed=done, total=total)

            packed = pack(self.motions, self.out, resume=self.resume, report=report)
        figures: dict[str, Any] = {
            "motions": packed.motions,
            "shards": packed.shards,
            "frames": packed.frames,
            "robots": sorted(packed.robots),
            "labels": {
                label: {"motions": count, "seconds": packed.seconds[label]}
                for label, count in sorted(packed.of_label.items())
            },
        }
        rows = [
            [label, str(of["motions"]), f"{of['seconds']:.1f}"]
            for label, of in figures["labels"].items()
        ]
        title = (
            f"{packed.motions} motions of {', '.join(figures['robots'])} in {self.out}"
        )
        do_all(
            lambda: print_table(title, ["label", "motions", "seconds"], rows),
            lambda: write_json(self.json, figures),
        )
        return 0
