"""Reference studies by the name that ``rig reproduce`` takes."""

from studies.reproduce.references.bouc_wen import BOUC_WEN
from studies.reproduce.references.brake_reuss import BRAKE_REUSS
from studies.reproduce.references.result import ReferenceStudy
from studies.reproduce.references.silverbox import SILVERBOX

STUDIES: dict[str, ReferenceStudy] = {study.data.name: study for study in (SILVERBOX, BOUC_WEN, BRAKE_REUSS)}
