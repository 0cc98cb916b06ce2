"""Files of backbones that were measured with other systems."""

from typing import TYPE_CHECKING, Any

from identification import Backbone
from rig.measurements.backbone_table import backbone_from, backbone_parts
from rig.results.kind import Storage

if TYPE_CHECKING:
    pass


def _pack(backbone: Backbone) -> tuple[dict[str, Any], dict[str, Any]]:
    contents = backbone_parts(backbone)
    return dict(contents.arrays), dict(contents.attributes)


STORAGE = Storage(_pack, backbone_from)
