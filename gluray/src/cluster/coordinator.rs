//! The first rank, inside the program. It sends updates to the helpers, renders its own share in
//! the meantime, and assembles all shares.
//!
//! A helper that does not reply, or whose reply is invalid, gets no further requests. The first
//! rank then renders that share itself, so no frame is lost.

use super::codec::{Reader, Wire};
use super::draw_message::{DrawMessage, images_of, name_of_attributes, name_of_image};
use super::rank_stats::RankStatsTable;
use super::requests::{
    REPLY, REQUEST, ReplyHeader, ViewParameters, Work, numbers, put_end, put_geometry, put_head,
    rect,
};
use super::row_share::{RowShare, get_rows, most_bytes};
use crate::capture::draw::{Attributes, Shading};
use crate::host::config::Settings;
use crate::trace::texturing::Image;
use crate::trace::{Prepared, Rect};
use composite::comm::Communicator;
use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Weak};
use std::time::{Duration, Instant};

/// The number of requests after which unused content is dropped.
const KEPT_ORDERS: u64 = 12;
/// The time that a helper may take in addition to ten times this rank's own share.
const PATIENCE: Duration = Duration::from_secs(20);
/// The size in bytes of a reply without its rows.
const REPLY_HEADER: usize = 1 << 16;

/// The state of a helper, as the first rank knows it.
#[derive(Default)]
struct HelperState {
    lost: bool,
    has: HashSet<u128>,
}

/// The first rank.
pub(crate) struct Coordinator {
    comm: Box<dyn Communicator + Send>,
    /// By rank; the first is never used.
    helpers: Vec<HelperState>,
    number: u64,
    /// Identifiers of content, with the last request that used each.
    used: HashMap<u128, u64>,
    attributes: ContentIds<Attributes>,
    images: ContentIds<Image>,
    pub(crate) rank_stats: RankStatsTable,
    /// The time that a helper may take in addition to ten times this rank's own share.
    pub(crate) patience: Duration,
}

/// Identifiers that are already computed.
struct ContentIds<T>(HashMap<usize, (Weak<T>, u128)>);

impl<T> ContentIds<T> {
    fn of(&mut self, value: &Arc<T>, name: impl FnOnce(&T) -> u128) -> u128 {
        let place = Arc::as_ptr(value) as usize;
        // The earlier object at this address may be gone, and another in its place.
        if let Some((known, name)) = self.0.get(&place)
            && known.upgrade().is_some_and(|k| Arc::ptr_eq(&k, value))
        {
            return *name;
        }
        let name = name(value);
        self.0.retain(|_, (known, _)| known.strong_count() > 0);
        self.0.insert(place, (Arc::downgrade(value), name));
        name
    }
}

/// The layers of an image, as far as shares have arrived.
pub(crate) struct PartialImage<A, B> {
    pub(crate) rect: Rect,
    pub(crate) first: Vec<A>,
    pub(crate) second: Vec<B>,
    pub(crate) rays: Vec<(&'static str, u64)>,
    pub(crate) warnings: Vec<String>,
}

impl Coordinator {
    pub(crate) fn new(comm: Box<dyn Communicator + Send>) -> Coordinator {
        let size = comm.size();
        Coordinator {
            comm,
            helpers: (0..size).map(|_| HelperState::default()).collect(),
            number: 0,
            used: HashMap::new(),
            attributes: ContentIds(HashMap::new()),
            images: ContentIds(HashMap::new()),
            rank_stats: RankStatsTable::new(size),
            patience: PATIENCE,
        }
    }

    fn alive(&self) -> Vec<usize> {
        (1..self.helpers.len()).filter(|r| !self.helpers[*r].lost).collect()
    }

    /// True while at least one helper is active.
    pub(crate) fn has_helpers(&self) -> bool {
        !self.alive().is_empty()
    }

    /// The image of `draws` within `rect`. `own` renders a share in this process.
    pub(crate) fn make<A: bytemuck::Pod, B: bytemuck::Pod>(
        &mut self,
        draws: &[Prepared<'_>],
        settings: &Settings,
        work: &Work,
        mut own: impl FnMut(RowShare) -> PartialImage<A, B>,
    ) -> PartialImage<A, B> {
        self.number += 1;
        let settings_text = serde_json::to_string(settings).unwrap_or_default();
        let draw_messages = self.draw_messages(draws);
        let forget = self.stale();

        // ---- Orders ----
        let ranks = self.alive();
        let count = ranks.len() as u32 + 1;
        let mut asked = Vec::new();
        for (i, rank) in ranks.into_iter().enumerate() {
            let share = RowShare { index: i as u32 + 1, count };
            let mut order = Vec::new();
            put_head(&mut order, self.number, &forget);
            self.put_update(&mut order, rank, draws, &draw_messages, &forget);
            put_end(&mut order, &settings_text, share, work, &draw_messages);
            self.rank_stats.of(rank).sent_bytes += order.len() as u64;
            match self.comm.send(rank, REQUEST, order) {
                Ok(()) => asked.push((rank, share)),
                Err(e) => {
                    self.lose(rank, &e.to_string());
                    asked.push((rank, share));
                }
            }
        }

        // ---- Our own share ----
        let start = Instant::now();
        let mut made = own(RowShare { index: 0, count });
        let took = start.elapsed();
        let account = self.rank_stats.of(0);
        account.pictures += 1;
        account.trace_ms += took.as_secs_f64() * 1e3;
        account.rays += made.rays.iter().map(|(_, n)| n).sum::<u64>();

        // ---- Theirs ----
        let patience = self.patience + took * 10;
        for (rank, share) in asked {
            let start = Instant::now();
            let done = match self.helpers[rank].lost {
                true => Err(String::new()),
                false => self.gather(rank, share, &mut made, patience),
            };
            self.rank_stats.of(0).wait_ms += start.elapsed().as_secs_f64() * 1e3;
            if let Err(why) = done {
                self.lose(rank, &why);
                put_in(&mut made, own(share), share);
            }
        }
        made
    }

    fn lose(&mut self, rank: usize, why: &str) {
        let helper = &mut self.helpers[rank];
        if !helper.lost {
            helper.lost = true;
            helper.has.clear();
            self.rank_stats.lost(rank, why);
        }
    }

    /// The draws as messages, with the identifiers of the content that they need.
    fn draw_messages(&mut self, draws: &[Prepared<'_>]) -> Vec<DrawMessage> {
        let number = self.number;
        let mut draw_messages = Vec::new();
        for p in draws {
            let draw = p.draw;
            let (images, attributes) = (&mut self.images, &mut self.attributes);
            let mut name = |i: &Arc<Image>| images.of(i, name_of_image);
            let [map, picture] = images_of(draw);
            let parcel = DrawMessage {
                geometry: draw.geometry.key,
                attributes: attributes.of(&draw.attributes, name_of_attributes),
                images: [
                    p.image.as_ref().map(&mut name),
                    map.map(&mut name),
                    picture.map(&mut name),
                ],
                state: (*draw.state).clone(),
                program: match &draw.shading {
                    Shading::Fixed => None,
                    Shading::Program(program) => {
                        Some((**program).clone().with_images([None, None]))
                    }
                },
                clip_from_object: draw.clip_from_object,
                ray_material: draw.ray_material,
            };
            self.used.insert(parcel.geometry, number);
            self.used.insert(parcel.attributes, number);
            self.used.extend(parcel.images.iter().flatten().map(|n| (*n, number)));
            draw_messages.push(parcel);
        }
        draw_messages
    }

    /// Identifiers that no recent request used.
    fn stale(&mut self) -> Vec<u128> {
        let now = self.number;
        let mut out: Vec<u128> = self
            .used
            .iter()
            .filter(|(_, at)| now - **at > KEPT_ORDERS)
            .map(|(name, _)| *name)
            .collect();
        out.sort_unstable();
        out.iter().for_each(|name| {
            self.used.remove(name);
        });
        out
    }

    /// Writes the content that a helper does not have yet.
    fn put_update(
        &mut self,
        out: &mut Vec<u8>,
        rank: usize,
        draws: &[Prepared<'_>],
        draw_messages: &[DrawMessage],
        forget: &[u128],
    ) {
        let has = &mut self.helpers[rank].has;
        forget.iter().for_each(|name| {
            has.remove(name);
        });
        let (mut geometries, mut attributes, mut images) = (Vec::new(), Vec::new(), Vec::new());
        let mut counts = [0_u64; 3];
        for (p, parcel) in draws.iter().zip(draw_messages) {
            if has.insert(parcel.geometry) {
                let mesh = &p.draw.geometry.mesh;
                put_geometry(&mut geometries, parcel.geometry, &mesh.positions, &mesh.indices);
                counts[0] += 1;
            }
            if has.insert(parcel.attributes) {
                parcel.attributes.put(&mut attributes);
                p.draw.attributes.put(&mut attributes);
                counts[1] += 1;
            }
            let [map, picture] = images_of(p.draw);
            for (name, image) in parcel.images.iter().zip([p.image.as_ref(), map, picture]) {
                if let (Some(name), Some(image)) = (name, image)
                    && has.insert(*name)
                {
                    name.put(&mut images);
                    image.put(&mut images);
                    counts[2] += 1;
                }
            }
        }
        (counts[0] as u32).put(out);
        out.append(&mut geometries);
        counts[1].put(out);
        out.append(&mut attributes);
        counts[2].put(out);
        out.append(&mut images);
    }

    /// Adds a helper's share to the image.
    fn gather<A: bytemuck::Pod, B: bytemuck::Pod>(
        &mut self,
        rank: usize,
        share: RowShare,
        made: &mut PartialImage<A, B>,
        patience: Duration,
    ) -> Result<(), String> {
        let size = [made.rect.w.max(0) as usize, made.rect.h.max(0) as usize];
        let pixel = size_of::<A>() + if made.second.is_empty() { 0 } else { size_of::<B>() };
        let most = REPLY_HEADER + most_bytes(share, size, pixel);
        let answer = self.comm.recv(rank, REPLY, most, patience).map_err(|e| e.to_string())?;
        let from = &mut Reader::new(&answer);
        let head = ReplyHeader::get(from).map_err(|e| format!("its answer: {e}"))?;
        if let Some(error_reply) = head.error_reply {
            return Err(error_reply.chars().filter(|c| !c.is_control()).take(300).collect());
        }
        if head.number != self.number || rect(head.rect) != made.rect {
            return Err(format!(
                "it answered order {} with {:?}, asked was {} with {:?}",
                head.number,
                head.rect,
                self.number,
                numbers(made.rect)
            ));
        }
        get_rows(from, share, size, (&mut made.first, &mut made.second))
            .and_then(|_| from.end())
            .map_err(|e| format!("its rows: {e}"))?;
        let kinds = super::requests::RAYS.into_iter().zip(head.cost.rays);
        made.rays.extend(kinds.filter(|(_, n)| *n > 0));
        made.warnings.extend(head.warnings);
        let account = self.rank_stats.of(rank);
        account.pictures += 1;
        account.trace_ms += head.cost.took_us as f64 * 1e-3;
        account.received_bytes += answer.len() as u64;
        account.builds += head.cost.builds;
        account.refits += head.cost.refits;
        account.rays += head.cost.rays.iter().sum::<u64>();
        self.comm.recycle(answer);
        Ok(())
    }
}

/// Adds a share that was rendered in this process to the image.
fn put_in<A: Copy, B: Copy>(
    made: &mut PartialImage<A, B>,
    part: PartialImage<A, B>,
    share: RowShare,
) {
    for range in share.pixels(made.rect.w.max(0) as usize, made.rect.h.max(0) as usize) {
        made.first[range.clone()].copy_from_slice(&part.first[range.clone()]);
        if !made.second.is_empty() {
            made.second[range.clone()].copy_from_slice(&part.second[range]);
        }
    }
    made.rays.extend(part.rays);
    made.warnings.extend(part.warnings);
}

/// The parameters of a view, as sent to helpers.
pub(crate) fn view_parameters(view: &crate::trace::view::View, rect: Rect) -> ViewParameters {
    ViewParameters {
        projection: view.projection.to_cols_array(),
        viewport: numbers(view.viewport),
        rect: numbers(rect),
    }
}
