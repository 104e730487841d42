"""State what a reception may hold and write, whatever is on the bus; what meets a limit is counted and told.

Each limit stands on what an honest node needs at most, or on what the machine can bear. `--json` has the counters
under `limits`, and each node's `left_out` says what was not taken of it.
"""

from __future__ import annotations

# nodes: 32 that have not described themselves; of those that have, all the numbers there are. Where 32 are described,
# 16 others still have a place: a forged number must bar no node.
NODES_MAX = 32
MUTE_LEAST = 16

# bytes of a node: 3.6 MB of messages that wait for a description (200,000 of 18 bytes: at 8,000 frames/s 25 s, and a
# description comes every 10 s), 1.6 MB of snapshots under way and 2.4 MB of two whole ones (65,536 parameters)
NODE_BYTES = 8 << 20
# bytes of all nodes: twenty-four at their own limit; beyond, those that hold most give up what waits
TOTAL_BYTES = 192 << 20
EARLY_MAX = 200_000  # messages kept for a node that has not described itself yet
LOOSE = 32  # batches that are held one by one before they are joined
PART_BYTES = 700  # of the Python objects that hold one batch

# configurations of a node: each description that differs makes one; a node is set up anew now and then, not for ever
CONFIGURATIONS_MAX = 64
PREVIOUS_KEPT = 4  # of them that are kept once their samples are on the disk

# runs: one that another follows has at least so many samples, or it is left out; a node has at most so many, and all
# nodes together so many files
RUN_LEAST = 16
RUNS_MAX = 256
FILES_MAX = 2048

# rows without a value: a run has at most so many, and so many for each row with one; beyond, a new run begins. So a
# recording is no longer than twice what arrived, and `identify` takes it (it refuses more missing than recorded).
FILL_FREE = 1000
FILL_SHARE = 1

RIVALS_MAX = 3  # counts of samples beside the one believed: strays, a restart, a second node of the same number
TWIN_LEAST = 32  # samples that contradict each other before two nodes are told; a quick restart makes at most 16
ANCHORS_FREE, ANCHORS_SHARE = 16, 16  # full indices looked at in a batch: 16, and one for each 16 messages
PIECES_MAX = 8  # pieces of a batch that the clock of a node is followed through

INNOVATIONS_AHEAD = 4096  # samples by which innovations may be ahead of the samples that were written

# modes: the moments of n regressors take n² numbers and a step n² operations; 600 are 3 MB and a third of a
# millisecond, four times what the turbine of the examples has (150)
MODES_REGRESSORS = 600
MODES_QUEUE_BYTES = 32 << 20  # of samples and snapshots that wait for the modes
MODES_FINISH_S = 3.0  # for which the end of a reception waits for modes that lag behind

HELD_SPARE = 8 << 20  # bytes set free when memory ends, so that the files can be completed
FLUSH_S = 1.0  # between two times that what has arrived goes to the disk
GATHER_S = 0.02  # that frames of a bus are gathered before they are looked at: a batch costs more than its frames
GATHER_FRAMES = 2048  # … or so many
