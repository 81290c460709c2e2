"""Results that keep every field of the engine's JSON."""

import json
from typing import Any


class Raw:
    """What the program prints with ``--json``."""

    __slots__ = ()

    raw: dict[str, Any]

    def to_dict(self) -> dict[str, Any]:
        """Every field."""
        return dict(self.raw)

    def to_json(self) -> str:
        """Every field as JSON."""
        return json.dumps(self.raw, ensure_ascii=False)
