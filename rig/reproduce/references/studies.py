"""Reference studies by the name that ``rig reproduce`` takes."""

from rig.reproduce.references.bouc_wen import BOUC_WEN
from rig.reproduce.references.brake_reuss import BRAKE_REUSS
from rig.reproduce.references.result import ReferenceStudy
from rig.reproduce.references.silverbox import SILVERBOX

STUDIES: dict[str, ReferenceStudy] = {study.data.name: study for study in (SILVERBOX, BOUC_WEN, BRAKE_REUSS)}
