import pytest
import torch

from loco_drake.cli.main import main
from loco_drake.common.device import find_device
from loco_drake.common.errors import InputError


@pytest.fixture
def no_gpu(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)


@pytest.fixture
def two_gpus(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)


def test_the_cpu_is_always_there(no_gpu):
    assert find_device("cpu") == torch.device("cpu")


def test_gpus_are_found_by_number(two_gpus):
    assert find_device("cuda") == torch.device("cuda")
    assert find_device("cuda:1") == torch.device("cuda:1")
    with pytest.raises(InputError, match=r"has 2 such GPU\(s\) for --device cuda:2"):
        find_device("cuda:2")


@pytest.mark.parametrize("name", ["gpu", "cuda:", "cuda:x", "meta", "cpu:0", ""])
def test_other_devices_are_unknown(name, two_gpus):
    with pytest.raises(InputError, match="the choices are cpu, cuda, and cuda:N"):
        find_device(name)


@pytest.mark.parametrize("name", ["tokenizer", "generator", "tracker", "classifier"])
def test_a_machine_without_gpu_says_so_before_any_work(name, no_gpu, tmp_path, capsys):
    out = tmp_path / "run"
    assert main(["train", name, "--device", "cuda", "--out", str(out)]) == 2
    assert capsys.readouterr().err == (
        "loco-drake: This machine has no such GPU for --device cuda, or its PyTorch "
        "cannot use it; leave out --device to learn on the CPU.\n"
    )
    assert not out.exists()
