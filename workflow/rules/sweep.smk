# A grid of stiffness and steps: shards of many cells, collected, and searched for the edges of stability.


# A shard's name is a digest of its scene and cells, so it needs no input file: another scene is another shard.
rule shard:
    output:
        "results/{study}/sweep/shards/{shard}.h5",
    params:
        # Snakemake compares plain data only; that `sweep` changed it learns from the shard's name.
        sweep=lambda wildcards: study(wildcards.study).sweep,
        cells=lambda wildcards: shards_of(wildcards.study)[wildcards.shard],
        code=code_of("shard.py", "stiffdice.sweep", "stiffdice.io.write"),
    log:
        "results/{study}/logs/shard/{shard}.log",
    benchmark:
        "results/{study}/benchmarks/shard/{shard}.tsv"
    priority: 10
    resources:
        mem_mb=700,
        runtime=30,
    conda:
        "../envs/stiffdice.yaml"
    script:
        "../scripts/shard.py"


rule collect:
    input:
        lambda wildcards: expand("results/{{study}}/sweep/shards/{shard}.h5", shard=shards_of(wildcards.study)),
    output:
        sweep="results/{study}/sweep/sweep.h5",
        table="results/{study}/sweep/shards.csv",
    params:
        code=code_of("collect.py", "stiffdice.sweep", "stiffdice.io.read", "stiffdice.io.write"),
    log:
        "results/{study}/logs/collect.log",
    benchmark:
        "results/{study}/benchmarks/collect.tsv"
    priority: 10
    resources:
        mem_mb=1000,
        runtime=10,
    conda:
        "../envs/stiffdice.yaml"
    script:
        "../scripts/collect.py"


rule frontier:
    input:
        "results/{study}/sweep/sweep.h5",
    output:
        data="results/{study}/sweep/frontier.h5",
        table=report(
            "results/{study}/sweep/frontier.csv",
            caption="../report/table.rst",
            category="{study}",
            labels={"what": "the numbers behind the frontier"},
        ),
    params:
        tolerances=lambda wildcards: dict(study(wildcards.study).tolerances),
        code=code_of("frontier.py", "stiffdice.frontier", "stiffdice.io.read", "stiffdice.io.write"),
    log:
        "results/{study}/logs/frontier.log",
    benchmark:
        "results/{study}/benchmarks/frontier.tsv"
    priority: 10
    resources:
        mem_mb=1000,
        runtime=10,
    conda:
        "../envs/stiffdice.yaml"
    script:
        "../scripts/frontier.py"
