"""Fine-tuning of a tokenizer's decoder, the codes held.

While the codes are learned, the losses also shape what codes can mean. Once they are
held, the decoder alone learns to write each code as exactly as it can. A generator that
was trained on the codes remains as good as it was.
"""

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from loco_drake.common.device import find_device
from loco_drake.common.errors import InputError
from loco_drake.generation.loop_settings import LoopSettings
from loco_drake.generation.point_masses import PointMasses
from loco_drake.generation.tokenizer import Tokenizer, load_tokenizer
from loco_drake.generation.tokenizer_score import Toes
from loco_drake.generation.train_tokenizer import (
    BATCH,
    WEIGHTS,
    Scales,
    save_trained,
    tokenizer_losses,
    weighed,
)
from loco_drake.generation.training import LoopResult, train
from loco_drake.generation.training_motions import Library
from loco_drake.generation.windows import PairedWindows, long_enough

_DECODER = ("decoder", "expand", "smooth")  # how the names of its layers begin
_WEIGHTS = {name: WEIGHTS[name] for name in WEIGHTS if name != "commitment"}
# Decoded codes move too smoothly, by a tenth of their acceleration, and it is
# acceleration by which generated motion is told from recordings. Heavier features
# would be more exact, and harder to follow: docs/generation_results.md.
_WEIGHTS["energy"] = 6.0


def train_decoder(
    library: Library, path: Path, settings: LoopSettings, books: int | None = None
) -> tuple[Tokenizer, LoopResult]:
    """Fine-tunes the decoder of the tokenizer at ``path``.

    Half of the batches are decoded from all codebooks, the others from the ``books``
    coarsest, as many as the generator writes; None: from all. Writes
    ``tokenizer.safetensors`` if it was not stopped.

    Raises:
        InputError: if no clip is as long as a window, the library has robots that the
            tokenizer does not know, the tokenizer has robots that were added to it, or
            it cannot be read.
    """
    base = load_tokenizer(path)
    robots = base.config.robots
    clips = long_enough(library.train)
    if base.config.added:
        raise InputError(
            f"{', '.join(base.config.added)} was added to the tokenizer and would be "
            "decoded otherwise: fine-tune the tokenizer that it was added to."
        )
    if missing := sorted(set(library.robots) - set(robots)):
        raise InputError(
            f"The tokenizer does not know {', '.join(missing)}, but {', '.join(robots)}"
            "; --add-to teaches it others."
        )
    codebooks = base.config.codebooks
    base.check_books(books)
    tokenizer = Tokenizer(replace(base.config, codes_of=base.fingerprint))
    tokenizer.load_state_dict(base.state_dict())
    tokenizer.requires_grad_(False)
    learning = nn.ModuleDict(
        {
            name: layers.requires_grad_(True)
            for name, layers in tokenizer.named_children()
            if name.startswith(_DECODER)
        }
    )
    device = find_device(settings.device)
    tokenizer.to(device)
    toes, masses = Toes(robots, device), PointMasses(robots, device)
    windows, scales = PairedWindows(clips, robots), Scales(clips, device)

    def loss_of_batch(random: np.random.Generator) -> tuple[Tensor, dict[str, float]]:
        target, robot, label = (x.to(device) for x in windows(random, BATCH))
        count = books if books is not None and random.random() < 0.5 else codebooks

        def decoded(
            features: Tensor, own: Tensor, decoded_for: Tensor
        ) -> tuple[Tensor, Tensor]:
            with torch.no_grad():
                codes = tokenizer.encode(features, own)[..., :count]
                embedded = tokenizer.lookup(codes)
            repeated = embedded.repeat(len(decoded_for) // len(own), 1, 1)
            held = torch.zeros((), device=device)
            return tokenizer.decode_embedded(repeated, decoded_for), held

        losses = tokenizer_losses(decoded, toes, masses, scales(label), target, robot)
        return weighed(losses, _WEIGHTS)

    run = {
        "network": asdict(tokenizer.config),
        "weights": _WEIGHTS,
        "motions": library.summary,
        "base": base.fingerprint,
        "books": books,
    }
    result = train("tokenizer", learning, loss_of_batch, settings, run)
    tokenizer.cpu().eval().requires_grad_(False)
    if not result.stopped:
        save_trained(tokenizer, library, settings, path)
    return tokenizer, result
