//! Completions of programs that have another name in `/usr/bin`.

/// The completion script of `program`, as clap writes it, for the same program under the name
/// `link`. Functions keep their names.
pub(super) fn renamed(script: &str, program: &str, link: &str) -> String {
    let of_shells = [
        // bash, at the end of the lines that begin with `complete -F`
        (format!(" {program}\n"), format!(" {link}\n"), "complete -F"),
        // zsh
        (format!("#compdef {program}"), format!("#compdef {link}"), "#compdef"),
        (format!("compdef _{program} {program}"), format!("compdef _{program} {link}"), "compdef"),
        // fish
        (format!("complete -c {program} "), format!("complete -c {link} "), "complete -c"),
    ];
    let mut out = String::new();
    for line in script.split_inclusive('\n') {
        let mut line = line.to_owned();
        for (from, to, head) in &of_shells {
            if line.trim_start().starts_with(head) {
                line = line.replace(from.as_str(), to);
            }
        }
        out += &line;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_shell_completes_the_new_name_and_calls_the_old_function() {
        for (script, expected) in [
            (
                "_bench() {\n    cmd=\"bench\"\n}\n    complete -F _bench -o default bench\n",
                "_bench() {\n    cmd=\"bench\"\n}\n    complete -F _bench -o default rtsv-bench\n",
            ),
            (
                "#compdef bench\n_bench() { }\n    compdef _bench bench\n",
                "#compdef rtsv-bench\n_bench() { }\n    compdef _bench rtsv-bench\n",
            ),
            ("complete -c bench -n \"x bench\" -f\n", "complete -c rtsv-bench -n \"x bench\" -f\n"),
        ] {
            assert_eq!(renamed(script, "bench", "rtsv-bench"), expected);
        }
    }
}
