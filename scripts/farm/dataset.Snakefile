# One job per shard of a data set, run by render-dataset in the data set's folder. A shard is done when its mark is there,
# whose name carries what was asked for; frames that are there already are not rendered again (docs/python.md).
import shlex

shards = int(config["shards"])


def launcher(threads):
    """Without the memory, which each try asks for anew: snakemake evaluates params once for all tries of a job, and
    resources for each."""
    if not config["launch"]:
        return ""
    return shlex.join([config["launch"], config["run"], str(threads)]) + ' "$memory_mb"'


rule all:
    input:
        [f"farm/{config['key']}/{n}-{shards}.done" for n in range(1, shards + 1)],


rule shard:
    output:
        touch("farm/{key}/{n}-{shards}.done"),
    threads: 1
    resources:
        mem_mb=lambda wildcards, attempt: attempt * int(config["memory_mb"]),
    params:
        command=lambda wildcards: shlex.join(
            [config["sonoplay"], "dataset", config["recipe"], "-o", ".", "--frames", str(config["frames"])]
            + ["--seed", str(config["seed"]), "--shard", f"{wildcards.n}/{wildcards.shards}"]
        ),
        launcher=lambda wildcards, threads: launcher(threads),
    shell:
        "exec >>farm/{wildcards.key}/{wildcards.n}-{wildcards.shards}.log 2>&1; memory_mb={resources.mem_mb}; {params.launcher} {params.command}"
