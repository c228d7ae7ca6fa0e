"""``python -m tests.fuzzing --count 3000 --keep FOLDER``; see the package."""

from tests.fuzzing.run import Options, fuzz

if __name__ == "__main__":
    import tyro

    raise SystemExit(fuzz(tyro.cli(Options)))
