# Bash completion of sonoplay.
_sonoplay() {
    local cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD - 1]}
    case $prev in
        --model) COMPREPLY=($(compgen -W "physical paper" -- "$cur")) ; return ;;
        --renderer) COMPREPLY=($(compgen -W "fast reference" -- "$cur")) ; return ;;
        --tracker) COMPREPLY=($(compgen -W "mouse null viper 3dg liberty sweep: replay: igtl:" -- "$cur")) ; return ;;
        --out | --stats | --record | --calibration) COMPREPLY=($(compgen -f -- "$cur")) ; return ;;
    esac
    if [[ $cur == -* ]]; then
        COMPREPLY=($(compgen -W "$(sonoplay --help 2>/dev/null | grep -o -- '--[a-z-]*' | sort -u)" -- "$cur"))
    else
        COMPREPLY=($(compgen -f -X '!*.sonocase' -- "$cur") $(compgen -d -- "$cur"))
    fi
}
complete -o filenames -F _sonoplay sonoplay
