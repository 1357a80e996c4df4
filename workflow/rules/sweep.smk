# A grid of stiffness and steps: shards of many runs, collected and judged, and searched for the edges of stability.


# A shard's name is a digest of what it holds or, in a later round, of what that follows from. So a survey need only be
# there: one that is made once more says the same.
rule shard:
    input:
        not_stale,
        survey=survey_of_shard,
    output:
        "results/{study}/sweeps/{sweep}/shards/{shard}.h5",
    log:
        "results/{study}/logs/shard/{sweep}/{shard}.log",
    benchmark:
        "results/{study}/benchmarks/shard/{sweep}/{shard}.tsv"
    priority: 10
    conda:
        "../envs/stiffdice.yaml"
    resources:
        mem_mb=growing(900),
        runtime=lambda wildcards, attempt: minutes_of(shard_of(wildcards)) * 2 ** (attempt - 1),
    params:
        planned=sealed("sweep"),
        asked=asked_of("shard", "{sweep}/{shard}"),
    script:
        "../scripts/shard.py"


# What the rounds up to one of them found, from which the next one's cells follow.
rule survey:
    input:
        not_stale,
        shards=made_from("shard", "survey", "{sweep}/{round}"),
        surveys=made_from("survey", "survey", "{sweep}/{round}"),
    output:
        sweep="results/{study}/sweeps/{sweep}/surveys/{round}.h5",
    log:
        "results/{study}/logs/survey/{sweep}/{round}.log",
    benchmark:
        "results/{study}/benchmarks/survey/{sweep}/{round}.tsv"
    priority: 10
    conda:
        "../envs/stiffdice.yaml"
    resources:
        mem_mb=growing(1000),
        runtime=growing(10),
    params:
        planned=sealed("sweep"),
        asked=asked_of("survey", "{sweep}/{round}"),
    script:
        "../scripts/collect.py"


rule collect:
    input:
        not_stale,
        shards=made_from("shard", "collect", "{sweep}"),
        surveys=made_from("survey", "collect", "{sweep}"),
    output:
        sweep="results/{study}/sweeps/{sweep}/sweep.h5",
        table="results/{study}/sweeps/{sweep}/shards.csv",
    log:
        "results/{study}/logs/collect/{sweep}.log",
    benchmark:
        "results/{study}/benchmarks/collect/{sweep}.tsv"
    priority: 10
    conda:
        "../envs/stiffdice.yaml"
    resources:
        mem_mb=growing(1000),
        runtime=growing(10),
    params:
        planned=sealed("sweep"),
        asked=asked_of("collect", "{sweep}"),
    script:
        "../scripts/collect.py"


rule frontier:
    input:
        not_stale,
        sweep="results/{study}/sweeps/{sweep}/sweep.h5",
    output:
        data="results/{study}/sweeps/{sweep}/frontier.h5",
        table=report(
            "results/{study}/sweeps/{sweep}/frontier.csv",
            caption="../report/frontier.rst",
            category=chapter,
            labels={"study": "{study}", "what": "{sweep}: the numbers behind the frontier"},
        ),
    log:
        "results/{study}/logs/frontier/{sweep}.log",
    benchmark:
        "results/{study}/benchmarks/frontier/{sweep}.tsv"
    priority: 10
    conda:
        "../envs/stiffdice.yaml"
    resources:
        mem_mb=growing(1000),
        runtime=growing(10),
    params:
        asked=asked_of("frontier", "{sweep}"),
    script:
        "../scripts/frontier.py"
