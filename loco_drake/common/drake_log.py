"""What Drake logs."""

import logging


def quiet_drake() -> None:
    """Drops what Drake logs below errors, permanently.

    Lower levels tell of harmless properties of models, such as inertias of massless
    links. Only for processes that belong to the library: commands and workers.
    """
    # Importing Drake resets the level, but no filter.
    logging.getLogger("drake").addFilter(_is_error)


def _is_error(record: logging.LogRecord) -> bool:
    return record.levelno >= logging.ERROR
