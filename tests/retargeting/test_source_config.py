import pytest

from loco_drake.common.errors import InputError
from loco_drake.retargeting.scaling import ContactConfig, load_config, read_config


def test_shipped_dog_says_where_its_hips_are():
    config = load_config("dog")
    assert (config.front_hip, config.rear_hip) == (0.05, -0.11)
    assert config.stance_height_percentile == 50.0


def test_source_without_configuration_names_those_with_one():
    with pytest.raises(InputError, match="'cat'; the choices are dog"):
        load_config("cat")


def test_fields_not_named_keep_their_default(tmp_path):
    (tmp_path / "cat.yaml").write_text(
        "contact:\n  land_height: 0.02\nrear_hip: -0.3\n"
    )
    config = read_config(tmp_path / "cat.yaml")
    assert config.contact.land_height == 0.02
    assert config.contact.leave_height == ContactConfig().leave_height
    assert (config.front_hip, config.rear_hip) == (0.0, -0.3)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("wings: 2\n", "wings"),
        ("rear_hip: far\n", "far"),
        ("rear_hip: .inf\n", "rear_hip must be finite"),
        ("{", "not a retargeting configuration"),
        ("smoothing: {toes: 0}\n", "smoothing.toes must be above 0"),
        ("contact: {land_speed: .nan}\n", "contact.land_speed must be above 0"),
        ("stance_height_percentile: 101\n", "within 0 to 100"),
        ("rear_hip: 0.1\nrear_hip: 0.2\n", "line 2 names 'rear_hip' a second time"),
    ],
)
def test_wrong_configuration_is_refused_with_the_reason(tmp_path, text, reason):
    (tmp_path / "cat.yaml").write_text(text)
    with pytest.raises(InputError, match=reason) as error:
        read_config(tmp_path / "cat.yaml")
    assert "\n" not in str(error.value)


def test_missing_configuration_is_refused(tmp_path):
    with pytest.raises(InputError, match="it should be a retargeting config"):
        read_config(tmp_path / "cat.yaml")
