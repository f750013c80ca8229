"""Sweeps: many designs, simulated batch by batch on any executor. `seastar sweep --help`.

In come a scene and axes, what differs from design to design; out go files of results, a number for every design and
column. `designs.py` says which designs there are, `run.py` how they swim and where results are kept, `executors.py`
where batches run, and `proposals.py` searches.

sweep = Sweep(Scene.preset("fast"), (Range("robot.limb_length", 0.05, 0.15), Choices("robot.n_limbs", (3, 5))), samples=1000)
run(sweep.batches(), "runs/limbs", Processes(2))
table = read_results("runs/limbs").to_pandas()
"""  # noqa: E501

from seastar_gym.files import require_extra

require_extra("Sweeps", "sweep", "pyarrow", "tqdm")
