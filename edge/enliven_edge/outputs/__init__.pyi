from .address import OutputAddress as OutputAddress
from .live_outputs import LiveOutputs as LiveOutputs, open_outputs as open_outputs
from .settings import LiveOutputSettings as LiveOutputSettings, outputs_of as outputs_of
