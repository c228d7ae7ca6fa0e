"""Files damaged in every way that was thought of."""

import numpy as np


def spoil(text: str, how: str) -> bytes:
    """Returns a file of comma-separated numbers, spoilt in the way named."""
    lines = text.splitlines()
    match how:
        case "empty":
            return b""
        case "blank":
            return b"\n\n"
        case "cut within a line":
            return text[: len(text) - 300].encode()
        case "cut within a number":
            return text[:-4].encode() + b"-"
        case "nan":
            fields = lines[7].split(",")
            fields[len(fields) // 2] = "nan"
            lines[7] = ",".join(fields)
        case "infinity":
            lines[7] = "inf," + lines[7].split(",", 1)[1]
        case "words":
            lines[3] = "a," + lines[3].split(",", 1)[1]
        case "semicolons":
            return text.replace(",", ";").encode()
        case "spaces":
            return text.replace(",", " ").encode()
        case "tabs":
            return text.replace(",", "\t").encode()
        case "column missing":
            lines = [line.rsplit(",", 1)[0] for line in lines]
        case "blank line":
            lines.insert(9, "")
        case "shuffled":
            np.random.default_rng(0).shuffle(lines)
        case "centimetres":
            lines = [
                ",".join(str(100 * float(value)) for value in line.split(","))
                for line in lines
            ]
        case "binary":
            return np.random.default_rng(1).bytes(5000)
        case "zeros":
            return bytes(5000)
        case "utf-16":
            return text.encode("utf-16")
        case _:
            raise AssertionError(how)
    return ("\n".join(lines) + "\n").encode()
