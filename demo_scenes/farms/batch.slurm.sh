#!/bin/bash
# A batch of ESH Scatter as a Slurm array: each task of the array makes its part of the scenes, the last one to end writes the table.
#
#   sbatch --array=1-20 batch.slurm.sh RECIPE.toml FOLDER A:B [options of esh-scatter batch]
#
#SBATCH --job-name=esh-scatter
#SBATCH --cpus-per-task=4
#SBATCH --mem=8G
#SBATCH --requeue
set -euo pipefail

recipe=$1 folder=$2 seeds=$3
shift 3
batch=(esh-scatter batch "$recipe" -o "$folder" --seeds "$seeds" --quiet "$@")

# Where no array was asked for, this is its only task.
first=${SLURM_ARRAY_TASK_MIN:-1} count=${SLURM_ARRAY_TASK_COUNT:-1}
part=$((${SLURM_ARRAY_TASK_ID:-1} - first + 1))
"${batch[@]}" --part "$part/$count"
# While others are at work the last part is not done: only whoever finds all scenes there writes the table.
"${batch[@]}" --collect
