# The workflow is in workflow/Snakefile, where others find it; here it is for `snakemake` in this folder.
include: "workflow/Snakefile"


workflow.default_target = "study"
