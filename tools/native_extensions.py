"""The extensions of an installation, for cffi's part of setuptools; see setup.py."""

from bms.native_build import FIRMWARE
from bms.studies.rivals.native_build import RIVALS
from hil_sim.native.native_build import NATIVE
from hil_sim.studies.campaign.native_build import RUNNER
from hil_sim.studies.pack.native_build import PACK

firmware, rivals, native, runner, pack = (
    extension.builder() for extension in (FIRMWARE, RIVALS, NATIVE, RUNNER, PACK)
)
