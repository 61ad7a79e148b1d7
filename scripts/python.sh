# shellcheck shell=bash disable=SC2154 # run and prepare.sh set what is not assigned here
# The Python packages that tests call with (aiortc, a WebRTC that is not ours) and store into (moto, an S3 server), in a folder
# of their own that only our wrapper knows: nothing is installed into a Python. pip fetches them from the index that this
# machine's pip is configured for, and takes nothing but the wheels that python.lock pins. Sourced by ./run.
#
#   $MON3TR_CACHE/python/run    the wrapper: `run ARGS...` is `python3 ARGS...` with these packages and no other

python_lock=$repo/scripts/python.lock

# Raise this when what is installed or written into the wrapper changes.
python_layout=1

# pip as one file: Debian's python3 comes without.
pip_version=26.3
pip_url=$pypi/07/25/ee8c38ae72d66b844ce8eb9711ba905dba21ca1a8a0c960057c41cd23337/pip-$pip_version-py3-none-any.whl
pip_sha256=f3b60b20ffaadd4415ed7957212a38ac63fa4c5fa375bd0f4a797777940fad13

python_oldest() { sed -n 's/^# pythons \([^ ]*\) .*/\1/p' "$python_lock"; }
python_newest() { sed -n 's/^# pythons [^ ]* //p' "$python_lock"; }
python_megabytes() { sed -n 's/^# megabytes //p' "$python_lock"; }

# find_python: sets python_found to the first interpreter the locked wheels are for, and python_is to what it is; else python_found
# to nothing and python_why to what is wrong with the machine's own.
find_python() {
	local one minor names=(python3)
	if [ -n "${python_found+known}" ]; then return; fi
	for ((minor = $(python_newest | cut -d. -f2); minor >= $(python_oldest | cut -d. -f2); minor--)); do names+=("python3.$minor"); done
	for one in "${names[@]}"; do
		if one=$(python_if_fit "$one"); then
			python_found=${one#*|} python_is=${one%%|*}
			return
		fi
		python_why=${python_why:-$one}
	done
	python_found=""
}

# python_if_fit NAME: prints `WHAT|PATH` if that interpreter fits, else why it does not. A call through a shim gets the
# interpreter itself, so that the wheels stay with it when the shim's choice changes.
python_if_fit() {
	command -v "$1" >/dev/null || { echo "there is no $1" && return 1; }
	"$1" -I -c '
import platform, sys, sysconfig
oldest, newest = (tuple(map(int, one.split("."))) for one in sys.argv[1:])
name = f"{platform.python_implementation()} {platform.python_version()}"
if sys.implementation.name != "cpython" or not oldest <= sys.version_info[:2] <= newest:
    sys.exit(print(f"python3 is {name}") or 1)
if sysconfig.get_config_var("Py_GIL_DISABLED"):
    sys.exit(print(f"python3 is {name} without a global lock") or 1)
print(f"cp{sys.version_info[0]}{sys.version_info[1]} {platform.machine()} {sys.executable}|{sys.executable}")
' "$(python_oldest)" "$(python_newest)" 2>/dev/null || return 1
}

python_pins() {
	find_python
	echo "$(sha256sum <"$python_lock" | cut -d' ' -f1) layout $python_layout on $python_is"
}

# python_is_there: something to point MON3TR_PYTHON at.
python_is_there() {
	find_python
	[ -n "${MON3TR_PYTHON:-}" ] || { [ -n "$python_found" ] && is_stamped "$MON3TR_CACHE/python" "$(python_pins)"; }
}

# Said where no interpreter fits, instead of installing.
explain_no_python() {
	local why
	why="${python_why:-python3 does not run}, but the packages that tests of the call need are locked for CPython $(python_oldest) to $(python_newest): install one of these beside it (found as python3.N on PATH), or point MON3TR_PYTHON to a python of your own that has aiortc, moto[s3], flask and flask-cors"
	if [ "${CI:-}" = true ]; then die "$why"; fi
	say "$why. Until then those tests skip themselves."
}

install_python() {
	local prefix=$MON3TR_CACHE/python new=$MON3TR_CACHE/python.new pip=$MON3TR_CACHE/download/pip-$pip_version-py3-none-any.whl
	say "Fetching aiortc and moto with what they need, for $python_found, from PyPI or the index pip is configured for"
	must_fetch "$pip_url" "$pip_sha256" "$pip"
	rm -rf "$new"
	mkdir -p "$new"
	# What a user's configuration may say of where and how to install is not meant for this folder; what it says of the index is.
	env -u PIP_PREFIX -u PIP_ROOT -u PIP_TARGET PIP_USER=0 PIP_REQUIRE_VIRTUALENV=0 PIP_ROOT_USER_ACTION=ignore \
		"$python_found" -I "$pip/pip" install --quiet --disable-pip-version-check --no-input --progress-bar off --no-compile \
		--target "$new/packages" --require-hashes --only-binary :all: --no-deps --requirement "$python_lock" >&2 ||
		die "pip could not install what $python_lock pins; it says why above. If that is the network: a proxy is set with https_proxy=..., another index with pip's own configuration (PIP_INDEX_URL=...). If it is a hash: that index does not carry PyPI's files. Then run the command again."
	"$python_found" -I -m compileall -q "$new/packages" >/dev/null || true
	cat >"$new/run" <<-WRAPPER
		#!/bin/sh
		# Written by ./run: python3 with the packages beside this script, and no others.
		here=\$(cd "\$(dirname "\$0")" && pwd) || exit 1
		export PYTHONPATH="\$here/packages" PYTHONNOUSERSITE=1 PYTHONDONTWRITEBYTECODE=1
		exec $(printf '%q' "$python_found") -S "\$@"
	WRAPPER
	chmod +x "$new/run"
	"$new/run" -c 'import aiortc, moto.server' >&2 ||
		die "the packages of $python_lock do not run on $python_found (why: above): is a shared library of the system missing? Then run the command again."
	put_in_place "$new" "$prefix" "$(python_pins)"
	rm -f "$pip"
}

export_python() { export MON3TR_PYTHON=${MON3TR_PYTHON:-$MON3TR_CACHE/python/run}; }
