# Bash completion of sonocase: verbs, kinds of a verb, options and their values. The tables are made from its help by
# scripts/packaging/manuals.
@TABLE@

_sonocase() {
    local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]}
    if ((COMP_CWORD == 1)); then
        mapfile -t COMPREPLY < <(compgen -W "$_sonocase_verbs --help --version" -- "$word")
        return
    fi
    local command=${COMP_WORDS[1]}
    if ((COMP_CWORD > 2)) && [[ -v _sonocase_options["$command ${COMP_WORDS[2]}"] ]]; then
        command+=" ${COMP_WORDS[2]}"
    fi
    local options=${_sonocase_options["$command"]:-} choices=${_sonocase_choices["$command $before"]:-}
    if [[ -n $choices ]]; then
        mapfile -t COMPREPLY < <(compgen -W "$choices" -- "$word")
    elif [[ $word == -* || $options != --* ]]; then
        mapfile -t COMPREPLY < <(compgen -W "$options" -- "$word")
    else
        mapfile -t COMPREPLY < <(compgen -f -- "$word")
    fi
}
complete -o filenames -F _sonocase sonocase
