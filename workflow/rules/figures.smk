# Datasets in, figures and tables out.


rule figure:
    input:
        not_stale,
        unpack(shown_by("figure", DRAWINGS)),
    output:
        report(
            "results/{study}/figures/{figure}.svg",
            caption="../report/figure.rst",
            category=chapter,
            labels={"study": "{study}", "what": "{figure}"},
        ),
        "results/{study}/figures/{figure}.png",
    params:
        planned=sealed("figure"),
        dpi=lambda wildcards: study(wildcards.study).dpi,
        asked=asked_of("figure", "{figure}"),
    log:
        "results/{study}/logs/figure/{figure}.log",
    benchmark:
        "results/{study}/benchmarks/figure/{figure}.tsv"
    resources:
        mem_mb=growing(700),
        runtime=growing(5),
    conda:
        "../envs/stiffdice.yaml"
    script:
        "../scripts/figure.py"


use rule figure as animation with:
    output:
        report(
            "results/{study}/figures/{figure}.gif",
            caption="../report/figure.rst",
            category=chapter,
            labels={"study": "{study}", "what": "{figure}"},
        ),
    params:
        planned=sealed("figure"),
        dpi=80,  # for screens, whatever the study asks of its PNG files
        asked=asked_of("animation", "{figure}"),
    log:
        "results/{study}/logs/animation/{figure}.log",
    benchmark:
        "results/{study}/benchmarks/animation/{figure}.tsv"


# On demand, as it would make a study with many figures slower.
use rule figure as pdf with:
    output:
        "results/{study}/figures/{figure}.pdf",
    params:
        planned=sealed("figure"),
        dpi=lambda wildcards: study(wildcards.study).dpi,
        asked=asked_of("pdf", "{figure}"),
    log:
        "results/{study}/logs/pdf/{figure}.log",
    benchmark:
        "results/{study}/benchmarks/pdf/{figure}.tsv"


rule table:
    input:
        not_stale,
        unpack(shown_by("table", TABLES)),
    output:
        markdown=report(
            "results/{study}/tables/{table}.md",
            caption="../report/table.rst",
            category=chapter,
            labels={"study": "{study}", "what": "{table}"},
        ),
        csv="results/{study}/tables/{table}.csv",
    params:
        planned=sealed("table"),
        asked=asked_of("table", "{table}"),
    log:
        "results/{study}/logs/table/{table}.log",
    benchmark:
        "results/{study}/benchmarks/table/{table}.tsv"
    resources:
        mem_mb=growing(700),
        runtime=growing(5),
    conda:
        "../envs/stiffdice.yaml"
    script:
        "../scripts/table.py"
