"""Exchange of backbones."""

from identification import Backbone
from rig.measurements.backbone_table import backbone_from, backbone_parts
from rig.results.kind import Exchange

EXCHANGE = Exchange("backbone", Backbone, backbone_parts, backbone_from)
