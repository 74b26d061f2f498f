# Bash completion of sonoplay. The tables are made from its help by scripts/packaging/manuals.
@TABLE@

_sonoplay() {
    local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]}
    local choices=${_sonoplay_choices["sonoplay $before"]:-}
    case $before in
        --tracker) choices="mouse null viper 3dg liberty sweep: replay: igtl:" ;;
        --effects) choices="auto all none" ;;
    esac
    if [[ -n $choices ]]; then
        mapfile -t COMPREPLY < <(compgen -W "$choices" -- "$word")
    elif [[ $word == -* ]]; then
        mapfile -t COMPREPLY < <(compgen -W "${_sonoplay_options[sonoplay]}" -- "$word")
    elif [[ $before == --* && $before != --headless ]]; then
        mapfile -t COMPREPLY < <(compgen -f -- "$word")
    else
        mapfile -t COMPREPLY < <(compgen -f -X '!*.sonocase' -- "$word"; compgen -d -- "$word")
    fi
}
complete -o filenames -F _sonoplay sonoplay
