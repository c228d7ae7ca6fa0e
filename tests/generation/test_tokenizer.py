import pytest
import torch

from loco_drake.common.errors import InputError
from loco_drake.common.weights import save_network
from loco_drake.generation.features import CONTACTS, SIZE
from loco_drake.generation.tokenizer import (
    Tokenizer,
    TokenizerConfig,
    load_tokenizer,
)
from loco_drake.generation.train_tokenizer import LearningTokenizer

TINY = TokenizerConfig(width=16, depth=2, frame_width=8, codebooks=3, codebook_size=8)


@pytest.fixture
def tokenizer():
    torch.manual_seed(0)
    learning = LearningTokenizer(Tokenizer(TINY))
    for _ in range(8):  # codebooks start from what they are given, some late
        learning(torch.randn(8, 32, SIZE), torch.zeros(8, dtype=torch.long))
    return learning.finish()


ROBOT = torch.zeros(1, dtype=torch.long)


def test_codes_are_the_nearest_of_each_residual(tokenizer):
    """Brute force over all codes, codebook by codebook."""
    features = torch.randn(1, 40, SIZE)
    with torch.no_grad():
        codes = tokenizer.encode(features, ROBOT)
        residual = tokenizer.embed(features, ROBOT)[0].double()
    codebooks = tokenizer.codebooks.double()
    assert codes.shape == (1, 10, TINY.codebooks)
    for codebook in range(TINY.codebooks):
        for step in range(10):
            distances = [
                float((residual[step] - c).norm()) for c in codebooks[codebook]
            ]
            assert codes[0, step, codebook] == distances.index(min(distances))
        residual = residual - codebooks[codebook][codes[0, :, codebook]]


def test_the_network_is_the_one_that_was_trained():
    """Codes and frames against those of the quantizer that learned the codebooks."""
    torch.manual_seed(0)
    learning = LearningTokenizer(Tokenizer(TINY))
    for _ in range(8):
        learning(torch.randn(8, 32, SIZE), torch.zeros(8, dtype=torch.long))
    tokenizer = learning.finish()
    learning.eval()
    features = torch.randn(1, 24, SIZE)
    with torch.no_grad():
        _, expected, _ = learning.quantizer(tokenizer.embed(features, ROBOT))
        output, _ = learning(features, ROBOT)
        codes = tokenizer.encode(features, ROBOT)
        decoded = tokenizer.decode(codes, ROBOT)
    assert torch.equal(codes, expected)
    torch.testing.assert_close(
        decoded[..., : CONTACTS.start], output[..., : CONTACTS.start]
    )
    torch.testing.assert_close(decoded[..., CONTACTS], output[..., CONTACTS].sigmoid())


def test_without_the_finer_books_their_vectors_are_zero(tokenizer):
    codes = torch.randint(8, (1, 6, 3))
    coarse = tokenizer.lookup(codes[..., :1])
    torch.testing.assert_close(coarse, tokenizer.codebooks[0][codes[..., 0]])
    with torch.no_grad():
        tokenizer.codebooks[1:] = 0.0
        a, b = tokenizer.decode(codes, ROBOT), tokenizer.decode(codes[..., :1], ROBOT)
    assert torch.equal(a, b)


def test_frames_do_not_depend_on_later_tokens(tokenizer):
    codes = torch.randint(8, (1, 12, 3))
    other = codes.clone()
    other[:, 7:] = (other[:, 7:] + 1) % 8
    with torch.no_grad():
        a, b = tokenizer.decode(codes, ROBOT), tokenizer.decode(other, ROBOT)
    assert torch.equal(a[:, :28], b[:, :28])
    assert not torch.allclose(a[:, 28:], b[:, 28:])


def test_codes_do_not_depend_on_later_frames(tokenizer):
    features = torch.randn(1, 48, SIZE)
    other = features.clone()
    other[:, 28:] += 1.0
    with torch.no_grad():
        a, b = tokenizer.embed(features, ROBOT), tokenizer.embed(other, ROBOT)
    assert torch.equal(a[:, :7], b[:, :7])
    assert not torch.allclose(a[:, 7:], b[:, 7:])


def test_frames_depend_on_no_more_than_memory_earlier_tokens(tokenizer):
    codes = torch.randint(8, (1, tokenizer.memory + 5, 3))
    with torch.no_grad():
        whole = tokenizer.decode(codes, ROBOT)
        part = tokenizer.decode(codes[:, 4:], ROBOT)
    frames = TINY.frames_per_token
    torch.testing.assert_close(
        part[:, tokenizer.memory * frames :], whole[:, -frames:], atol=1e-6, rtol=0
    )


def test_memory_is_not_longer_than_needed(tokenizer):
    codes = torch.randint(8, (1, tokenizer.memory + 1, 3))
    other = codes.clone()
    other[:, 0] = (other[:, 0] + 1) % 8
    with torch.no_grad():
        a, b = tokenizer.decode(codes, ROBOT), tokenizer.decode(other, ROBOT)
    frames = TINY.frames_per_token
    assert not torch.equal(a[:, -frames:], b[:, -frames:])


def test_normalization_is_part_of_the_weights(tokenizer, tmp_path):
    features = torch.randn(500, SIZE) * 3 + 5
    tokenizer.set_statistics(features.mean(dim=0), features.std(dim=0))
    save_network(tmp_path / "t.safetensors", "tokenizer", tokenizer, half=True)
    loaded = load_tokenizer(tmp_path / "t.safetensors")
    torch.testing.assert_close(loaded.mean[0], torch.tensor(5.0), atol=0.5, rtol=0)
    torch.testing.assert_close(loaded.std[0], torch.tensor(3.0), atol=0.4, rtol=0)


def test_saved_in_16_bits_it_keeps_its_fingerprint(tokenizer, tmp_path):
    path = tmp_path / "t.safetensors"
    save_network(path, "tokenizer", tokenizer, half=True)
    loaded = load_tokenizer(path)
    assert loaded.config == TINY
    assert loaded.fingerprint == tokenizer.fingerprint
    with torch.no_grad():
        tokenizer.decoder_in.weight[0, 0] += 1.0
    assert loaded.fingerprint != tokenizer.fingerprint


def test_damaged_weights_are_refused(tokenizer, tmp_path):
    path = tmp_path / "t.safetensors"
    save_network(path, "tokenizer", tokenizer, half=True)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(InputError, match="damaged"):
        load_tokenizer(path)
    with pytest.raises(InputError, match="no tokenizer weights"):
        load_tokenizer(tmp_path / "missing.safetensors")


def test_weights_of_another_size_are_refused(tokenizer, tmp_path):
    from loco_drake.common.weights import save_weights

    path = tmp_path / "t.safetensors"
    network = {"robots": ["go2"], "width": 24}
    save_weights(path, "tokenizer", tokenizer.state_dict(), {"network": network})
    with pytest.raises(InputError, match="do not fit"):
        load_tokenizer(path)
    save_weights(path, "tokenizer", tokenizer.state_dict(), {"network": {"x": 1}})
    with pytest.raises(InputError, match="header"):
        load_tokenizer(path)
