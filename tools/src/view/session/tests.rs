use super::*;
use proptest::prelude::*;

const SIZE: [u32; 2] = [800, 600];

fn session() -> Session {
    let bounds = [[0.0, -10.0, 2.0], [40.0, 10.0, 12.1]];
    let styles = ["solid", "boundary"].map(str::to_owned).into();
    let part =
        ViewedStore { bounds, unit: "mm".to_owned(), pitch: 0.5, styles, voids: voids(), legend: None };
    Session::new(part, View::named("front").unwrap(), 0, SIZE)
}

/// Two voids of a table, one of them beside the part.
fn voids() -> Vec<VoidPlace> {
    let void = |id, centre: [f64; 3], half: f64| VoidPlace {
        id,
        centre,
        low: centre.map(|c| c - half),
        high: centre.map(|c| c + half),
    };
    vec![void(1, [10.0, 2.0, 7.0], 1.5), void(2, [30.0, -4.0, 9.0], 0.5)]
}

#[test]
fn voids_are_looked_at_one_by_one_and_cut_through() {
    let mut session = session();
    assert!(!session.status().contains("void"));
    for (key, id) in [("n", 1), ("n", 2), ("n", 1), ("b", 2), ("b", 1)] {
        keys(&mut session, key);
        let (shot, void) = (session.shot(), voids()[id - 1]);
        assert_eq!(seen(&session, void.centre), [0.0; 2]);
        let cut = shot.cut.expect("a cut");
        assert!(cut.axis == Axis::Z && cut.at == void.centre[2] && cut.above);
        // All of the void is in the window.
        assert!(shot.focus.height > void.high[0] - void.low[0]);
        assert!(session.status().contains(&format!("void {id} of 2")), "{}", session.status());
    }
    // Across the axis of the cut, the same side stays.
    keys(&mut session, "xx");
    assert!(session.go_to_void(2) && !session.go_to_void(3));
    let cut = session.shot().cut.expect("a cut");
    assert!(cut.axis == Axis::X && cut.at == 30.0 && !cut.above);
    // Without a table nothing happens.
    let part = ViewedStore { voids: Vec::new(), ..session.part().clone() };
    let mut bare = Session::new(part, View::named("front").unwrap(), 0, SIZE);
    let before = bare.shot();
    keys(&mut bare, "nb");
    assert!(bare.shot() == before);
}

fn keys(session: &mut Session, keys: &str) {
    keys.chars().for_each(|letter| assert_eq!(session.handle(Event::Key(Key::Letter(letter))), None));
}

/// Where a point of the world is seen, in pixels from the window's middle, to the right and upward.
fn seen(session: &Session, point: [f64; 3]) -> [f64; 2] {
    let [right, up, _] = session.view.axes();
    let along = |axis: [f64; 3]| -> f64 {
        (0..3).map(|a| axis[a] * (point[a] - session.focus.centre[a])).sum::<f64>() / session.pixel()
    };
    [along(right), along(up)]
}

#[test]
fn the_part_follows_the_pointer() {
    let mut session = session();
    session.handle(Event::Point([300.0, 200.0]));
    session.handle(Event::Press { button: Button::Left, shift: false });
    session.handle(Event::Point([310.0, 220.0]));
    let View { azimuth, elevation, .. } = session.shot().view;
    assert!((azimuth + 94.0).abs() < 1e-9 && (elevation - 8.0).abs() < 1e-9, "{azimuth} {elevation}");
    session.handle(Event::Release);
    session.handle(Event::Point([400.0, 220.0]));
    assert_eq!(session.shot().view.azimuth, azimuth);
    // What lies under the pointer stays there, whatever moves the part.
    for (button, shift) in [(Button::Right, false), (Button::Middle, false), (Button::Left, true)] {
        let point = [3.0, 4.0, 5.0];
        let [x, y] = seen(&session, point);
        session.handle(Event::Press { button, shift });
        session.handle(Event::Point([430.0, 215.0]));
        let [u, v] = seen(&session, point);
        assert!((u - x - 30.0).abs() < 1e-9 && (v - y - 5.0).abs() < 1e-9);
        session.handle(Event::Release);
        session.handle(Event::Point([400.0, 220.0]));
    }
}

#[test]
fn the_wheel_zooms_around_the_pointer() {
    let mut session = session();
    session.handle(Event::Point([650.0, 100.0]));
    let [right, up, _] = session.view.axes();
    let pixel = session.pixel();
    let under: [f64; 3] =
        std::array::from_fn(|a| session.focus.centre[a] + (right[a] * 250.0 + up[a] * 200.0) * pixel);
    session.handle(Event::Wheel(3.0));
    assert!((pixel / session.pixel() - 1.2f64.powi(3)).abs() < 1e-9);
    let [x, y] = seen(&session, under);
    assert!((x - 250.0).abs() < 1e-9 && (y - 200.0).abs() < 1e-9, "{x} {y}");
    for notches in [1e9, -1e9, f64::NAN] {
        session.handle(Event::Wheel(notches));
        assert!(session.shot().focus.height.is_finite() && session.shot().focus.height > 0.0);
    }
}

#[test]
fn keys_do_what_the_help_says() {
    let mut session = session();
    keys(&mut session, "2");
    assert_eq!(session.shot().view, View::named("top").unwrap());
    keys(&mut session, "pt");
    assert_eq!((session.shot().view.opening, session.shot().style), (30.0, 1));
    keys(&mut session, "th9");
    assert!(session.shot().style == 0 && session.shows_help());
    // The plane, its other side, another axis, and none.
    keys(&mut session, "x");
    assert_eq!(session.shot().cut, Some(CutPlane { axis: Axis::X, at: 20.0, above: true }));
    keys(&mut session, "x");
    assert_eq!(session.shot().cut, Some(CutPlane { axis: Axis::X, at: 20.0, above: false }));
    keys(&mut session, "z");
    assert_eq!(session.shot().cut, Some(CutPlane { axis: Axis::Z, at: 7.5, above: true }));
    assert!(session.status().ends_with("z < 7.500 mm, layer 11 of 21"), "{}", session.status());
    session.handle(Event::Key(Key::PageUp));
    session.handle(Event::Key(Key::PageUp));
    // The last layer is a thin one.
    assert_eq!(session.shot().cut.unwrap().at, 12.1);
    session.handle(Event::Key(Key::Home));
    assert_eq!(session.shot().cut.unwrap().at, 2.5);
    keys(&mut session, "c");
    assert_eq!(session.shot().cut, None);
    assert_eq!(session.handle(Event::Key(Key::Letter('s'))), Some(WindowRequest::Screenshot));
    assert_eq!(session.handle(Event::Key(Key::Escape)), Some(WindowRequest::Quit));
}

#[test]
fn the_slider_goes_through_the_layers() {
    let mut session = session();
    session.handle(Event::Point([799.0, 300.0]));
    session.handle(Event::Press { button: Button::Left, shift: false });
    assert_eq!(session.shot().cut, Some(CutPlane { axis: Axis::Z, at: 7.0, above: true }));
    // Beyond the window's edge there is no more than all, and no less than a layer.
    for (y, at) in [(-50.0, 12.1), (900.0, 2.5), (600.0 * 0.2, 10.0)] {
        session.handle(Event::Point([100.0, y]));
        assert_eq!(session.shot().cut.unwrap().at, at);
    }
    assert_eq!(session.shot().view, View::named("front").unwrap());
}

#[test]
fn the_whole_part_stays_whole_until_the_user_looks_closer() {
    let mut session = session();
    let resize = |size| Event::Resize { size, density: 2.0 };
    session.handle(resize([300, 900]));
    let fitted = session.shot();
    assert_eq!(fitted.focus, fitted.view.fit(session.part.bounds, [300, 900]).unwrap());
    session.zoom(2.0);
    let close = session.shot().focus;
    session.handle(resize([900, 300]));
    assert_eq!(session.shot().focus, close);
    keys(&mut session, "f");
    assert_ne!(session.shot().focus, close);
}

/// The plane may rest at the lower end where what is above stays; taken up again, it takes away what is above.
#[test]
fn a_plane_that_rested_at_the_lower_end_leaves_a_layer() {
    let mut session = session();
    keys(&mut session, "zz");
    session.handle(Event::Key(Key::Home));
    assert_eq!(session.shot().cut, Some(CutPlane { axis: Axis::Z, at: 2.0, above: false }));
    keys(&mut session, "xz");
    assert_eq!(session.shot().cut, Some(CutPlane { axis: Axis::Z, at: 2.5, above: true }));
}

fn any_event() -> impl Strategy<Value = Event> {
    let button = prop::sample::select(vec![Button::Left, Button::Right, Button::Middle]);
    let letter = prop::sample::select("xyzcfpth1234567".chars().collect::<Vec<_>>());
    let other = prop::sample::select(vec![Key::Up, Key::Down, Key::PageUp, Key::Home, Key::End]);
    prop_oneof![
        (button, any::<bool>()).prop_map(|(button, shift)| Event::Press { button, shift }),
        Just(Event::Release),
        (-2e3..2e3, -2e3..2e3).prop_map(|(x, y)| Event::Point([x, y])),
        (-20.0..20.0).prop_map(Event::Wheel),
        letter.prop_map(|letter| Event::Key(Key::Letter(letter))),
        other.prop_map(Event::Key),
        (0u32..4000, 0u32..4000, 0.0..4.0)
            .prop_map(|(w, h, density)| Event::Resize { size: [w, h], density }),
    ]
}

proptest! {
    /// Whatever the user does, there is a picture to be drawn of it.
    #[test]
    fn every_shot_can_be_drawn(events in prop::collection::vec(any_event(), 0..60)) {
        let mut session = session();
        for event in events {
            session.handle(event);
            let Shot { view, focus, cut, style, size } = session.shot();
            prop_assert!((-180.0..=180.0).contains(&view.azimuth));
            prop_assert!((-90.0..=90.0).contains(&view.elevation));
            prop_assert!(focus.height > 0.0 && focus.centre.iter().all(|c| c.abs() < 1e3));
            prop_assert!(style < 2 && !size.contains(&0));
            if let Some(CutPlane { axis, at, above }) = cut {
                let [low, high] = session.part.ends(axis);
                let leaves = if above { low < at && at <= high } else { low <= at && at < high };
                prop_assert!(leaves, "{low} {at} {high}");
            }
            prop_assert!(session.slider_left() <= size[0] && !session.status().contains('\n'));
        }
    }
}
