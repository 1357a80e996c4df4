# A grid of stiffness and steps: shards of many runs, collected and judged, and searched for the edges of stability.


# A shard's name is a digest of its scene and columns, so it needs no input file: another scene is another shard.
rule shard:
    output:
        "results/{study}/sweeps/{sweep}/shards/{shard}.h5",
    params:
        # Snakemake compares plain data only; that `sweep` changed it learns from the shard's name.
        sweep=lambda wildcards: planned_sweep(wildcards),
        columns=lambda wildcards: shards_of(wildcards.study, wildcards.sweep)[wildcards.shard],
        code=lambda wildcards: code_of_runs("shard.py", planned_sweep(wildcards).simulator, "stiffdice.sweep"),
    log:
        "results/{study}/logs/shard/{sweep}/{shard}.log",
    benchmark:
        "results/{study}/benchmarks/shard/{sweep}/{shard}.tsv"
    priority: 10
    resources:
        mem_mb=growing(700),
        runtime=growing(30),
    conda:
        "../envs/stiffdice.yaml"
    script:
        "../scripts/shard.py"


rule collect:
    input:
        lambda wildcards: expand(
            "results/{{study}}/sweeps/{{sweep}}/shards/{shard}.h5", shard=shards_of(wildcards.study, wildcards.sweep)
        ),
    output:
        sweep="results/{study}/sweeps/{sweep}/sweep.h5",
        table="results/{study}/sweeps/{sweep}/shards.csv",
    params:
        sweep=lambda wildcards: planned_sweep(wildcards),  # no plain data, so not compared
        tolerances=lambda wildcards: dict(planned_sweep(wildcards).criteria),
        code=code_of("collect.py", "stiffdice.sweep", "stiffdice.io.read", "stiffdice.io.write"),
    log:
        "results/{study}/logs/collect/{sweep}.log",
    benchmark:
        "results/{study}/benchmarks/collect/{sweep}.tsv"
    priority: 10
    resources:
        mem_mb=growing(1000),
        runtime=growing(10),
    conda:
        "../envs/stiffdice.yaml"
    script:
        "../scripts/collect.py"


rule frontier:
    input:
        sweep="results/{study}/sweeps/{sweep}/sweep.h5",
    output:
        data="results/{study}/sweeps/{sweep}/frontier.h5",
        table=report(
            "results/{study}/sweeps/{sweep}/frontier.csv",
            caption="../report/frontier.rst",
            category="{study}",
            labels={"what": "{sweep}: the numbers behind the frontier"},
        ),
    params:
        code=code_of("frontier.py", "stiffdice.frontier", "stiffdice.io.read", "stiffdice.io.write"),
    log:
        "results/{study}/logs/frontier/{sweep}.log",
    benchmark:
        "results/{study}/benchmarks/frontier/{sweep}.tsv"
    priority: 10
    resources:
        mem_mb=growing(1000),
        runtime=growing(10),
    conda:
        "../envs/stiffdice.yaml"
    script:
        "../scripts/frontier.py"
