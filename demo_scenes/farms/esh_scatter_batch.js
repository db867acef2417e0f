// A job type of Flamenco: a batch of ESH Scatter. One task for each part of the scenes, then one that writes the table.

const JOB_TYPE = {
    label: "ESH Scatter Batch",
    settings: [
        { key: "recipe", type: "string", subtype: "file_path", required: true,
          description: "The recipe that is varied; its images lie beside it" },
        { key: "output", type: "string", subtype: "dir_path", required: true,
          description: "Folder for the scenes and the table" },
        { key: "seeds", type: "string", default: "0:1000",
          description: "Seeds from A to B - 1, as A:B; one scene for each" },
        { key: "variations", type: "string", default: "",
          description: "What varies, separated by spaces: class[pine].count=100:200 balance.class_separation=normal(0.5, 0.1)" },
        { key: "parts", type: "int32", default: 10,
          description: "Into how many tasks the scenes are divided" },
        { key: "command", type: "string", default: "esh-scatter",
          description: "The command on the workers; a variable of Flamenco such as {esh-scatter} is filled in" },
    ],
};

// Spaces within brackets and quotes belong to a word.
function words(text) {
    const found = [""];
    let depth = 0, quote = "";
    for (const letter of text) {
        if (quote) {
            quote = letter === quote ? "" : quote;
        } else if (letter === "'" || letter === '"') {
            quote = letter;
        } else {
            depth += "[{(".includes(letter) - ")}]".includes(letter);
        }
        if (letter.trim() || depth || quote) {
            found[found.length - 1] += letter;
        } else {
            found.push("");
        }
    }
    return found.filter((word) => word);
}

function compileJob(job) {
    const settings = job.settings;
    const args = ["batch", settings.recipe, "-o", settings.output, "--seeds", settings.seeds, "--quiet"];
    for (const variation of words(settings.variations)) {
        args.push("--set", variation);
    }
    const collect = author.Task("table", "misc");
    collect.addCommand(author.Command("exec", { exe: settings.command, args: args }));
    for (let part = 1; part <= settings.parts; part++) {
        const solve = author.Task(`part-${part}`, "misc");
        solve.addCommand(author.Command("exec", {
            exe: settings.command,
            args: args.concat(["--part", `${part}/${settings.parts}`]),
        }));
        job.addTask(solve);
        collect.addDependency(solve);
    }
    job.addTask(collect);
}
