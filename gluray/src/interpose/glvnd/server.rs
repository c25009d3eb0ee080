//! Asks an X server for the vendors of a screen, with two requests of the X protocol (X11, and GLX
//! 1.4's `glXQueryServerString`). The requests are made without a library, because such a library
//! would be part of what is to be chosen.

use super::screen_of;
use std::io::{Read, Write};
use std::net::{TcpStream, ToSocketAddrs as _};
use std::os::linux::net::SocketAddrExt as _;
use std::os::unix::net::{SocketAddr, UnixStream};
use std::path::Path;
use std::time::Duration;

/// A server that does not answer must not hang a program.
const PATIENCE: Duration = Duration::from_secs(3);
const COOKIE: &[u8] = b"MIT-MAGIC-COOKIE-1";
/// `GLX_VENDOR_NAMES_EXT` of `GLX_EXT_libglvnd`.
const VENDOR_NAMES: u32 = 0x20f6;
const QUERY_EXTENSION: u8 = 98;
const GLX_QUERY_SERVER_STRING: u8 = 19;
/// More bytes than any answer has.
const MOST_BYTES: usize = 1 << 20;

trait Stream: Read + Write {}
impl<S: Read + Write> Stream for S {}

/// The names that the server of a display gives for its screen, the best first. The error is the
/// reason why there are none.
pub(super) fn vendor_names(display: &str, authority: Option<&Path>) -> Result<Vec<String>, String> {
    let (host, number) =
        display.rsplit_once(':').ok_or_else(|| format!("`{display}` is no display"))?;
    let number: u16 = number
        .split('.')
        .next()
        .and_then(|n| n.parse().ok())
        .ok_or_else(|| format!("`{display}` has no number"))?;
    let cookie = authority.and_then(|file| cookie(&std::fs::read(file).ok()?, number));
    let fault = |e: std::io::Error| format!("{display}: {e}");
    let mut stream = connect(host, number).map_err(fault)?;
    ask(stream.as_mut(), cookie.as_deref(), screen_of(display)).map_err(fault)
}

fn connect(host: &str, number: u16) -> std::io::Result<Box<dyn Stream>> {
    if host.is_empty() || host == "unix" {
        let path = format!("/tmp/.X11-unix/X{number}");
        let abstract_name = SocketAddr::from_abstract_name(&path)?;
        let stream =
            UnixStream::connect(&path).or_else(|_| UnixStream::connect_addr(&abstract_name))?;
        stream.set_read_timeout(Some(PATIENCE))?;
        stream.set_write_timeout(Some(PATIENCE))?;
        return Ok(Box::new(stream));
    }
    let host = host.strip_prefix("tcp/").unwrap_or(host).trim_matches(['[', ']']);
    let port = number.checked_add(6000).ok_or(std::io::ErrorKind::InvalidInput)?;
    let address = (host, port).to_socket_addrs()?.next().ok_or(std::io::ErrorKind::NotFound)?;
    let stream = TcpStream::connect_timeout(&address, PATIENCE)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    Ok(Box::new(stream))
}

/// The cookie for a display's number in the text of an authority file.
fn cookie(file: &[u8], number: u16) -> Option<Vec<u8>> {
    let mut rest = file;
    fn field<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
        let (length, behind) = rest.split_first_chunk::<2>()?;
        let (text, behind) = behind.split_at_checked(usize::from(u16::from_be_bytes(*length)))?;
        *rest = behind;
        Some(text)
    }
    while rest.len() > 2 {
        rest = &rest[2..];
        let [_, of, name, data] = [(); 4].map(|()| field(&mut rest));
        let (of, name, data) = (of?, name?, data?);
        if (of.is_empty() || of == number.to_string().as_bytes()) && name == COOKIE {
            return Some(data.to_vec());
        }
    }
    None
}

fn padded(out: &mut Vec<u8>, bytes: &[u8]) {
    out.extend(bytes);
    out.resize(out.len().next_multiple_of(4), 0);
}

fn word<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    std::array::from_fn(|k| bytes[at + k])
}

fn ask(
    stream: &mut dyn Stream,
    cookie: Option<&[u8]>,
    screen: u32,
) -> std::io::Result<Vec<String>> {
    let refused = |what: &str| std::io::Error::other(what.to_owned());
    let (name, data) = cookie.map_or((&b""[..], &b""[..]), |c| (COOKIE, c));
    let mut hello = vec![b'l', 0, 11, 0, 0, 0];
    hello.extend((name.len() as u16).to_le_bytes());
    hello.extend((data.len() as u16).to_le_bytes());
    hello.extend([0; 2]);
    padded(&mut hello, name);
    padded(&mut hello, data);
    stream.write_all(&hello)?;
    let mut head = [0; 8];
    stream.read_exact(&mut head)?;
    let more = 4 * usize::from(u16::from_le_bytes(word(&head, 6)));
    stream.read_exact(&mut vec![0; more])?;
    if head[0] != 1 {
        return Err(refused("the server lets nobody in without its cookie"));
    }
    let mut query = vec![QUERY_EXTENSION, 0, 3, 0, 3, 0, 0, 0];
    padded(&mut query, b"GLX");
    stream.write_all(&query)?;
    let (extension, _) = reply(stream)?;
    if extension[0] != 1 || extension[8] == 0 {
        return Err(refused("the server has no GLX"));
    }
    let mut query = vec![extension[9], GLX_QUERY_SERVER_STRING, 3, 0];
    query.extend(screen.to_le_bytes());
    query.extend(VENDOR_NAMES.to_le_bytes());
    stream.write_all(&query)?;
    let (answer, text) = reply(stream)?;
    let length = u32::from_le_bytes(word(&answer, 12)) as usize;
    match text.get(..length) {
        Some(text) if answer[0] == 1 => {
            let text = String::from_utf8_lossy(text);
            Ok(text.trim_end_matches('\0').split_whitespace().map(str::to_owned).collect())
        }
        _ => Err(refused("the server does not know GLX_EXT_libglvnd")),
    }
}

/// A reply or an error, and the data that follows it.
fn reply(stream: &mut dyn Stream) -> std::io::Result<([u8; 32], Vec<u8>)> {
    let mut head = [0; 32];
    stream.read_exact(&mut head)?;
    let more = if head[0] == 1 { 4 * u32::from_le_bytes(word(&head, 4)) as usize } else { 0 };
    if more > MOST_BYTES {
        return Err(std::io::ErrorKind::InvalidData.into());
    }
    let mut rest = vec![0; more];
    stream.read_exact(&mut rest)?;
    Ok((head, rest))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::TcpListener;

    /// A server for one client, which gives `names` for screen 1, or no answer to the question
    /// where there are none. Its display, and what it was sent as a cookie.
    fn fake(names: Option<&'static str>) -> (String, std::thread::JoinHandle<Vec<u8>>) {
        let listen = |n: u16| Some((n, TcpListener::bind(("127.0.0.1", 6000 + n)).ok()?));
        let (number, listener) = (900..2000).find_map(listen).expect("a free port");
        let answered = std::thread::spawn(move || {
            let (mut s, _) = listener.accept().expect("a client");
            let mut hello = [0; 12];
            s.read_exact(&mut hello).expect("a greeting");
            let [name, data] = [6, 8].map(|at| usize::from(u16::from_le_bytes(word(&hello, at))));
            let mut proof = vec![0; name.next_multiple_of(4) + data.next_multiple_of(4)];
            s.read_exact(&mut proof).expect("a cookie");
            s.write_all(&[1, 0, 11, 0, 0, 0, 2, 0]).expect("sent");
            s.write_all(&[7; 8]).expect("sent");
            let mut query = [0; 12];
            s.read_exact(&mut query).expect("the question for GLX");
            assert_eq!((query[0], &query[8..11]), (QUERY_EXTENSION, &b"GLX"[..]));
            let mut there = [0; 32];
            (there[0], there[8], there[9]) = (1, 1, 150);
            s.write_all(&there).expect("sent");
            s.read_exact(&mut query).expect("the question for vendors");
            assert_eq!(query, [150, 19, 3, 0, 1, 0, 0, 0, 0xf6, 0x20, 0, 0]);
            let mut answer = vec![0; 32];
            if let Some(names) = names {
                let mut text = Vec::new();
                padded(&mut text, format!("{names}\0").as_bytes());
                answer[0] = 1;
                answer[4..8].copy_from_slice(&(text.len() as u32 / 4).to_le_bytes());
                answer[12..16].copy_from_slice(&(names.len() as u32 + 1).to_le_bytes());
                answer.extend(text);
            }
            s.write_all(&answer).expect("sent");
            proof
        });
        (format!("127.0.0.1:{number}.1"), answered)
    }

    #[test]
    fn a_server_names_vendors_for_its_screen_to_who_has_the_cookie() {
        let (display, server) = fake(Some("nvidia mesa"));
        let number =
            display.rsplit_once(':').and_then(|(_, n)| n.split_once('.')).expect("a number").0;
        let mut file = Vec::new();
        for (of, data) in [("1", b"wrong"), (number, b"right")] {
            file.extend([1, 0]);
            for field in [&b"host"[..], of.as_bytes(), COOKIE, data] {
                file.extend((field.len() as u16).to_be_bytes());
                file.extend(field);
            }
        }
        let place = tempfile::tempdir().expect("a folder");
        let authority = place.path().join("authority");
        std::fs::write(&authority, file).expect("a file");
        assert_eq!(
            vendor_names(&display, Some(&authority)),
            Ok(vec!["nvidia".into(), "mesa".into()])
        );
        let proof = server.join().expect("a server");
        assert!(proof.starts_with(COOKIE) && proof[20..].starts_with(b"right"), "{proof:?}");
    }

    #[test]
    fn a_server_that_knows_no_vendors_or_is_not_there_is_named() {
        let (display, server) = fake(None);
        let why = vendor_names(&display, None).expect_err("no names");
        assert!(why.contains("GLX_EXT_libglvnd") && why.contains(&display), "{why}");
        assert_eq!(server.join().expect("a server"), b"");
        assert!(vendor_names("127.0.0.1:59000", None).is_err());
        assert!(vendor_names("nonsense", None).expect_err("no display").contains("nonsense"));
        assert!(vendor_names(":60999", None).is_err());
    }
}
