from . import (
    contract as contract,
)
from . import (
    description as description,
)
from . import (
    export as export,
)
from . import (
    learned as learned,
)
from . import (
    open_loop as open_loop,
)
from . import (
    registry as registry,
)
from . import (
    search as search,
)
from .contract import Policy as Policy
from .learned import LearnedPolicy as LearnedPolicy
from .learned import load as load
from .learned import pretrained as pretrained
from .open_loop import scripted as scripted
from .registry import load_agent as load_agent
from .registry import load_agents as load_agents
from .search import GreedyPolicy as GreedyPolicy
from .search import Planner as Planner
