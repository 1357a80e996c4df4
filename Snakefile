# stiffdice: config -> scenes -> runs -> shards -> sweep -> frontier -> figures; experiments and timings -> figures.
#
#   snakemake paper                       everything the paper shows
#   snakemake stability                   what "stable" means, measured
#   snakemake extremes                    where and how runs fail at the extremes
#   snakemake tradeoff                    what accuracy costs, by scheme
#   snakemake refinement                  whether fewer runs, put where members disagree, say as much
#   snakemake landing                     how often each face of a die is up, and how coarse steps may be for that
#   snakemake engines                     other engines beside stiffdice, as far as they are installed
#   snakemake tosses                      real tosses of a cube, and the simulation beside them
#   snakemake shapes                      which face of a box comes up, by shape and load
#   snakemake pair                        two cubes that meet: steps they need, how they leave each other
#   snakemake study --config study=NAME   everything that config/NAME.yaml asks for
#   snakemake finished --report FILE      no job: a report of all studies that are finished
#
# A study is a file in config/; its results lie in results/ under the same name.

from snakemake.utils import min_version

min_version("9.0")


include: "workflow/rules/common.smk"
include: "workflow/rules/scenes.smk"
include: "workflow/rules/sweep.smk"
include: "workflow/rules/experiments.smk"
include: "workflow/rules/figures.smk"


report: "workflow/report/workflow.rst"


onstart:
    one_at_a_time()
    clear_way()
    set_aside_changed()
    ready_for_cluster()
    tell_how_long()


onerror:
    tell_of_cluster()


rule paper:
    default_target: True
    input:
        lambda wildcards: everything_of("paper"),


rule stability:
    input:
        lambda wildcards: everything_of("stability"),


rule extremes:
    input:
        lambda wildcards: everything_of("extremes"),


rule tradeoff:
    input:
        lambda wildcards: everything_of("tradeoff"),


rule refinement:
    input:
        lambda wildcards: everything_of("refinement"),


rule landing:
    input:
        lambda wildcards: everything_of("landing"),


rule tosses:
    input:
        lambda wildcards: everything_of("tosses"),


rule engines:
    input:
        lambda wildcards: everything_of("engines"),


rule shapes:
    input:
        lambda wildcards: everything_of("shapes"),


rule pair:
    input:
        lambda wildcards: everything_of("pair"),


rule finished:
    input:
        lambda wildcards: everything_finished(),


rule study:
    input:
        lambda wildcards: everything_of(str(config.get("study", "paper"))),
