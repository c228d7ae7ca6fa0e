"""What others published, or what was measured on what they published.

"The paper" is "Learning Robot Locomotion from Diverse Datasets". Its authors released
150 retargeted and 360 generated clips for the Go2; figures "of its clips" were measured
on those with the definitions of this project. What is not here is not published.
"""

from dataclasses import dataclass

from loco_drake.evaluation.confidence import Estimate, wilson

SOURCES = {
    "all": "All",
    "dog": "Dog",
    "horse": "Horse",
    "mpc": "MPC",
    "solo8": "Solo8",
}

COMPARISONS = {
    "real_to_real": "recorded → recorded",
    "real_to_generated": "recorded → generated (quality)",
    "generated_to_real": "generated → recorded (diversity)",
}

# The paper's Table 1. It prints the shares; the counts, right of all, are the only ones
# that give all of its rows (15 gaits of 10 clips, 4 of them for validation; 24
# generated).
_TABLE_1 = {
    "all": ((56, 60), (265, 360), (50, 60)),
    "dog": ((8, 9), (44, 72), (9, 9)),
    "horse": ((9, 9), (34, 48), (7, 9)),
    "mpc": ((13, 15), (80, 96), (14, 15)),
    "solo8": ((26, 27), (107, 144), (20, 27)),
}


def table_1(source: str, comparison: str) -> Estimate:
    """Returns an entry of the paper's Table 1, with Wilson's 95 % interval.

    Args:
        source: "all" or a source.
        comparison: a key of COMPARISONS.
    """
    right, of = _TABLE_1[source][list(COMPARISONS).index(comparison)]
    return Estimate(right / of, *wilson(right / of, of))


# A linear classifier on the paper's clips: mean of 20 random splits.
LINEAR = {
    "real_to_real": 0.999,
    "real_to_generated": 0.997,
    "generated_to_real": 1.0,
}

# Figures of generation of the paper's clips, by key.
CLIPS = {"two_sample_accuracy": 0.852}


@dataclass(frozen=True)
class Size:
    """One row of what the networks are: the paper's release beside ours.

    Attributes:
        part: of the pipeline.
        paper: in words.
        ours: in words, with fields of the weights' configurations in braces.
    """

    part: str
    paper: str
    ours: str


# The paper's column is what its authors' release does by default.
SIZES = (
    Size(
        "Retargeting",
        "damped inverse kinematics of the toes, frame by frame",
        "inverse kinematics of the toes; feet in stance stay where they landed, "
        "soles above ground, joint angles and speeds within limits",
    ),
    Size(
        "Tokenizer",
        "transformer VQ-VAE; 4 product books of 128 codes, 25 tokens/s; one robot",
        "causal VQ-VAE; {books} residual books of {book_size} codes, "
        "{tokens_per_second:g} tokens/s; {robots}",
    ),
    Size(
        "Generator",
        "GPT of 1 layer, 4 heads, 128 channels; gait, source and duration; up to 4 s",
        "GPT of {layers} layers, {heads} heads, {width} channels, over {window} "
        "tokens; gait, source and duration; any length",
    ),
    Size(
        "Smoother",
        "not published",
        "TOPP-RA: within the motors' speeds and accelerations, never faster than the "
        "plan",
    ),
    Size(
        "Policy",
        "512-256-128 units, 104 observations; corrects a fixed stance by .3 rad "
        "per unit of action",
        "{hidden} units, {observations} observations, mirror-symmetric; corrects the "
        "planned joints by {action_scale:g} rad per unit of action",
    ),
    Size("Simulator", "MuJoCo, 5 ms", "Drake, feet of rubber, 10 ms"),
    Size(
        "Training of the policy",
        "PPO, 1e9 steps on a GPU",
        "PPO, two processes on a CPU",
    ),
)
