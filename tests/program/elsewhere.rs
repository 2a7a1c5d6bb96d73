//! Stores on web servers, as their users read them.

mod server;

use crate::support::*;
use server::{Asked, Reply, Server};
use std::ffi::OsStr;
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::Duration;

/// Runs the program where no proxy stands between it and the server.
fn fetch(args: &[&dyn AsRef<OsStr>]) -> Run {
    let args = args.iter().map(|arg| arg.as_ref());
    program().args(args).env("NO_PROXY", "127.0.0.1").output().unwrap().into()
}

/// A store of a pile of beads, and its bytes.
fn pile(dir: &Scratch, depth: u8) -> (PathBuf, Vec<u8>) {
    let (input, store) = (dir.pile("pile.stl", 4000), dir.path("pile.brf"));
    run(&[&"build", &input, &"-o", &store, &"--depth", &depth.to_string(), &"--quiet"]).ok_but_for("");
    let bytes = std::fs::read(&store).unwrap();
    (store, bytes)
}

/// The one line that the program ends with.
#[track_caller]
fn refused(server: &Server, words: [&str; 2]) {
    let line = fetch(&[&"info", &server.address]).failed();
    assert!(line.contains(&server.address) && words.iter().all(|words| line.contains(words)), "{line}");
}

#[test]
fn answers_are_those_of_the_file() {
    let dir = Scratch::new();
    let (store, bytes) = pile(&dir, 3);
    let server = Server::of(bytes);
    let points = dir.file("points.csv", "1,1,1\n50,50,2\n30.5,20,5\n99,1,1\n-5,0,0\n");
    let [here, there] = ["here", "there"].map(|name| move |ending: &str| format!("{name}.{ending}"));
    let runs: [(&[&str], Option<&str>); 6] = [
        (&["info", "--volume"], None),
        (&["cache", "ls"], None),
        (&["sample", "--json", "--points", points.to_str().unwrap()], None),
        (&["slice", "--z", "3"], Some("png")),
        (&["mesh", "--level", "2"], Some("stl")),
        (&["render", "--size", "200x100"], Some("png")),
    ];
    for (words, ending) in runs {
        let outputs = ending.map(|ending| [dir.path(&here(ending)), dir.path(&there(ending))]);
        let told = [0, 1].map(|side| {
            let mut args: Vec<&dyn AsRef<OsStr>> = words.iter().map(|word| word as _).collect();
            let of: &dyn AsRef<OsStr> = if side == 0 { &store } else { &server.address };
            args.push(of);
            if let Some(outputs) = &outputs {
                args.extend([&"-o" as &dyn AsRef<OsStr>, &outputs[side]]);
            }
            fetch(&args).ok()
        });
        match outputs {
            Some(outputs) => {
                let [here, there] = outputs.map(|output| std::fs::read(output).unwrap());
                assert!(here == there, "{words:?}");
            }
            None => {
                let name = store.display().to_string();
                assert_eq!(told[0].replace(&name, &server.address), told[1], "{words:?}");
            }
        }
    }
    fetch(&[&"verify", &server.address]).ok();
}

#[test]
fn a_coarse_picture_fetches_little_and_many_ranges_at_once() {
    let dir = Scratch::new();
    let (store, bytes) = pile(&dir, 4);
    let (length, copy) = (bytes.len(), bytes.clone());
    let server = Server::new(Duration::from_millis(20), move |asked| Reply::range(asked, &copy, "1"));
    let [here, there] = ["here.png", "there.png"].map(|name| dir.path(name));
    let draw = |store: &dyn AsRef<OsStr>, out: &PathBuf| {
        fetch(&[&"render", store, &"-o", out, &"--size", &"300x200", &"--lod", &"8", &"--supersample", &"1"])
            .ok()
    };
    draw(&store, &here);
    draw(&server.address, &there);
    assert!(std::fs::read(here).unwrap() == std::fs::read(there).unwrap());
    // No byte comes twice, but for gaps between records.
    assert!(server.bytes() < length / 2, "{} of {length}", server.bytes());
    assert!((2..=16).contains(&server.most_at_once()), "{}", server.most_at_once());
    let mut ranges = server.ranges();
    ranges.sort_unstable();
    assert!(ranges.windows(2).all(|pair| pair[0].1 < pair[1].0), "{ranges:?}");
}

#[test]
fn a_store_in_the_order_of_levels_takes_fewer_requests() {
    let dir = Scratch::new();
    let (store, bytes) = pile(&dir, 4);
    let levels = dir.path("levels.brf");
    run(&[&"cache", &"repack", &store, &"-o", &levels, &"--order", &"level", &"--quiet"]).ok();
    let servers = [bytes, std::fs::read(levels).unwrap()].map(Server::of);
    let pictures = servers.each_ref().map(|server| {
        let out = dir.path("view.png");
        fetch(&[&"render", &server.address, &"-o", &out, &"--size", &"300x200", &"--level", &"3"]).ok();
        std::fs::read(out).unwrap()
    });
    assert!(pictures[0] == pictures[1]);
    let requests = servers.each_ref().map(Server::requests);
    assert!(requests[1] * 2 < requests[0], "{requests:?}");
    assert!(servers[1].bytes() <= servers[0].bytes());
}

#[test]
fn cut_connections_are_made_again() {
    let dir = Scratch::new();
    let (store, bytes) = pile(&dir, 2);
    // Two of three answers end in the middle, the first before its first byte, some servers are busy.
    let server = Server::new(Duration::ZERO, move |asked| match asked.number % 4 {
        0 => Reply::range(asked, &bytes, "1").cut_at(0),
        1 => Reply::range(asked, &bytes, "1").cut_at(1000),
        2 => Reply::status("503 Service Unavailable", b"busy"),
        _ => Reply::range(asked, &bytes, "1"),
    });
    let told = fetch(&[&"info", &server.address]).ok();
    let here = fetch(&[&"info", &store]).ok();
    assert_eq!(here.replace(&store.display().to_string(), &server.address), told);
}

#[test]
fn a_server_that_stops_answering_is_an_error() {
    let dir = Scratch::new();
    let (_, bytes) = pile(&dir, 2);
    let index = |asked: &Asked| asked.range.is_some_and(|(first, _)| first > 0);
    let server = Server::new(Duration::ZERO, move |asked| match index(asked) {
        true => Reply::range(asked, &bytes, "1").cut_at(10),
        false => Reply::range(asked, &bytes, "1"),
    });
    refused(&server, ["was cut", "6 times in a row; check the network and the server"]);
    let nobody = "http://127.0.0.1:1/part.brf";
    let line = fetch(&[&"info", &nobody]).failed();
    assert!(line.contains("takes no connection; check the network"), "{line}");
}

#[test]
fn a_file_that_is_replaced_is_an_error_and_nothing_is_written() {
    let dir = Scratch::new();
    let (_, bytes) = pile(&dir, 3);
    let longer = [&bytes[..], b"more"].concat();
    let first = Mutex::new(true);
    let other = move |asked: &Asked| match asked.range {
        Some((0, _)) => true,
        _ => std::mem::take(&mut *first.lock().unwrap()),
    };
    let with_tag = {
        let bytes = bytes.clone();
        Server::new(Duration::ZERO, move |asked| {
            Reply::range(asked, &bytes, if other(asked) { "1" } else { "2" })
        })
    };
    let of_length = Server::new(Duration::ZERO, move |asked| match asked.number < 2 {
        true => Reply::range(asked, &bytes, "1"),
        false => Reply::range(asked, &longer, "1"),
    });
    let out = dir.path("view.png");
    for server in [with_tag, of_length] {
        let line = fetch(&[&"render", &server.address, &"-o", &out, &"--size", &"64x64"]).failed();
        assert!(line.contains("has been replaced since it was opened; give the command again"), "{line}");
        assert!(!out.exists() && dir.names().iter().all(|name| !name.contains("view.png")));
    }
}

#[test]
fn bytes_that_are_not_those_of_the_store_are_never_believed() {
    let dir = Scratch::new();
    let (_, bytes) = pile(&dir, 2);
    // A proxy that answers the same range with other bytes, under the same tag.
    let server = Server::new(Duration::ZERO, move |asked| {
        let mut reply = Reply::range(asked, &bytes, "1");
        if asked.range.is_some_and(|(first, _)| first > 0) {
            let middle = reply.body.len() / 2;
            reply.body[middle] ^= 1;
        }
        reply
    });
    refused(&server, ["the checksum differs", "restore the file"]);
}

#[test]
fn servers_that_do_not_send_ranges_are_told_apart() {
    let dir = Scratch::new();
    let (_, bytes) = pile(&dir, 2);
    let serve = |change: fn(Reply) -> Reply| {
        let bytes = bytes.clone();
        Server::new(Duration::ZERO, move |asked| change(Reply::range(asked, &bytes, "1")))
    };
    let status = |status: &'static str| Server::new(Duration::ZERO, move |_| Reply::status(status, b"page"));
    let copy = "copy the file here first";
    refused(&status("200 OK"), ["the server sends whole files only", copy]);
    refused(&status("404 Not Found"), ["no such file (404 Not Found)", "check the address"]);
    refused(&status("403 Forbidden"), ["does not let this be read", "without signing in"]);
    refused(&status("418 I'm a teapot"), ["does not send the file (418", copy]);
    refused(&Server::of(Vec::new()), ["the file is empty", "copied"]);
    refused(
        &serve(|reply| reply.with("Content-Range", "bytes 5-9/100")),
        ["not the range that was asked for", copy],
    );
    refused(
        &serve(|reply| reply.with("Content-Range", "bytes 0-12287/*")),
        ["not the range that was asked for", copy],
    );
    refused(&serve(|reply| reply.with("Content-Encoding", "gzip")), ["packs what it sends", copy]);
    refused(
        &serve(|mut reply| {
            reply.body.pop();
            reply
        }),
        ["12287 bytes in place of the 12288", copy],
    );
    refused(&Server::of(b"no store at all".to_vec()), ["this is not a brick store", "give a file"]);
    refused(&Server::of(bytes[..bytes.len() - 1].to_vec()), ["shorter than its commit says", "restore"]);
}

#[test]
fn redirects_are_followed_and_looked_up_again_when_they_end() {
    let dir = Scratch::new();
    let (_, bytes) = pile(&dir, 2);
    let signed =
        Server::new(Duration::ZERO, move |asked| match asked.path == "/signed" && asked.number % 3 == 2 {
            // What was given for a while has ended.
            true => Reply::status("403 Forbidden", b""),
            false => Reply::range(asked, &bytes, "1"),
        });
    let target = signed.address.replace("part.brf", "signed");
    let server =
        Server::new(Duration::ZERO, move |_| Reply::status("302 Found", b"").with("Location", &target));
    let told = fetch(&[&"info", &server.address, &"--volume"]).ok();
    assert!(told.starts_with(&server.address), "{told}");
    assert!(server.requests() < signed.requests() && server.requests() > 1);
}

#[test]
fn addresses_where_files_are_wanted_are_told_apart() {
    let dir = Scratch::new();
    let server = Server::of(b"solid".to_vec());
    let out = dir.path("out.brf");
    let stl = server.address.replace("brf", "stl");
    let line = fetch(&[&"build", &stl, &"-o", &out, &"--depth", &"2"]).failed();
    assert!(line.contains("only stores are read from servers; copy the file here first"), "{line}");
    let line = fetch(&[&"info", &"http://me:secret@127.0.0.1/part.brf"]).failed();
    assert!(line.contains("user and password in the address are not sent"), "{line}");
    for bad in ["http://", "http:///part.brf", "http://127.0.0.1/a part.brf"] {
        let line = fetch(&[&"info", &bad]).failed();
        assert!(line.contains("this is no address") && !line.contains("panicked"), "{line}");
    }
}
