#!/bin/sh
# Compiles the page's decoder: build.sh OUT.wasm [RUSTC]. With the compiler of Debian 12 the bytes are those that are committed:
# apt-get install --no-install-recommends rustc libstd-rust-dev-wasm32 lld
set -eu
case $1 in /*) out=$1 ;; *) out=$PWD/$1 ;; esac
rustc=${2:-/usr/bin/rustc}
here=$(cd "$(dirname "$0")" && pwd)
made=$(mktemp -d)
trap 'rm -rf "$made"' EXIT
flags="--edition 2021 --target wasm32-unknown-unknown -C opt-level=2 -C panic=abort -C codegen-units=1 -C embed-bitcode=yes"
cd "$here/.."
"$rustc" $flags --crate-type rlib --crate-name brickfield_coding --remap-path-prefix "$here/.."=. -o "$made/libbrickfield_coding.rlib" src/lib.rs
"$rustc" $flags -C lto=fat -C strip=symbols --crate-type cdylib --crate-name decoder --remap-path-prefix "$here/.."=. --extern "brickfield_coding=$made/libbrickfield_coding.rlib" -o "$made/decoder.wasm" page/decoder.rs
chmod 644 "$made/decoder.wasm"
mv "$made/decoder.wasm" "$out"
